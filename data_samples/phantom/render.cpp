#include "data_samples/phantom/render.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "data_samples/phantom/head_motion.hpp"
#include "data_samples/phantom/slice_sampler.hpp"
#include "pipeline/base/parallel.hpp"

namespace emmetrope::phantom {
namespace {

/// Margin around the image, so that the field of view's edge does not ring into it.
int margin_of(int pixels) { return std::max(8, pixels / 32); }

}  // namespace

RenderedStack render(const Anatomy& anatomy, const Protocol& protocol, std::size_t index, int threads,
                     const std::function<void()>& advance) {
  const Disturbances& disturbances = protocol.disturbances;
  RenderedStack stack;
  stack.plan = protocol.stacks.at(index);
  stack.scanner_from_reference = stack_movement(anatomy.between_globes(), disturbances, index);
  stack.sigma = disturbances.snr > 0 ? reference_intensity / disturbances.snr : 0;
  const StackPlan& plan = stack.plan;
  stack.slices.resize(plan.slices);

  const Sensitivity sensitivity(plan, anatomy);
  const int margin_x = margin_of(plan.columns);
  const int margin_y = margin_of(plan.rows);
  const int columns = plan.columns + 2 * margin_x;
  const int rows = plan.rows + 2 * margin_y;

  const auto render_slice = [&](int number) {
    std::mt19937_64 random = slice_random(disturbances.seed, index, number);
    const Eigen::Isometry3d moved = slice_movement(disturbances, random) * stack.scanner_from_reference;
    const SlicePose pose{stack.position(-margin_x, -margin_y, number), moved.inverse(),
                         1 + disturbances.scale_error};
    const SliceSampler sampler(anatomy, plan, sensitivity, pose, columns, rows);
    KSpace k_space;
    k_space.acquired_readout = plan.acquired_readout;
    k_space.acquired_phase = plan.acquired_phase;
    k_space.fat_shift_px = disturbances.chemical_shift_px;
    k_space.sigma = stack.sigma;
    k_space.window = disturbances.window;
    k_space.noise_variation = disturbances.noise_variation;
    k_space.echo_train = disturbances.echo_train;
    k_space.ghost = disturbances.ghost;
    k_space.seed = random();
    std::vector<float> image = magnitude_image(sampler.sample(), k_space);
    if (disturbances.slice_gain > 0) {
      const double gain = std::exp(std::normal_distribution<double>(0, disturbances.slice_gain)(random));
      for (float& value : image) value *= static_cast<float>(gain);
    }
    std::vector<float>& out = stack.slices[number];
    out.reserve(static_cast<std::size_t>(plan.rows) * plan.columns);
    for (int row = 0; row < plan.rows; ++row) {
      const auto* begin = image.data() + static_cast<std::size_t>(row + margin_y) * columns + margin_x;
      out.insert(out.end(), begin, begin + plan.columns);
    }
    if (advance) advance();
  };

  on_threads(threads, static_cast<std::size_t>(plan.slices),
             [&](std::size_t number) { render_slice(static_cast<int>(number)); });
  return stack;
}

}  // namespace emmetrope::phantom
