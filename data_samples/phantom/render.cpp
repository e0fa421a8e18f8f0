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

/// Points through a slice near the globes and elsewhere, or through a layer of an encoded one.
struct Points {
  int near_globe, elsewhere;
};
constexpr Points through_slice{10, 4}, through_layer{3, 1};

class Renderer {
 public:
  Renderer(const Anatomy& anatomy, const Protocol& protocol, std::size_t index, int threads)
      : anatomy_(anatomy),
        disturbances_(protocol.disturbances),
        index_(index),
        threads_(threads),
        stack_(planned(anatomy, protocol, index)),
        plan_(stack_.plan),
        sensitivity_(plan_, anatomy),
        margin_x_(margin_of(plan_.columns)),
        margin_y_(margin_of(plan_.rows)),
        columns_(plan_.columns + 2 * margin_x_),
        rows_(plan_.rows + 2 * margin_y_) {}

  RenderedStack render(const std::function<void()>& advance) {
    if (plan_.profile == SliceProfile::encoded)
      encode(advance);
    else
      on_threads(threads_, static_cast<std::size_t>(plan_.slices), [&](std::size_t slice) {
        excite(static_cast<int>(slice));
        if (advance) advance();
      });
    return std::move(stack_);
  }

 private:
  static RenderedStack planned(const Anatomy& anatomy, const Protocol& protocol, std::size_t index) {
    const Disturbances& disturbances = protocol.disturbances;
    RenderedStack stack;
    stack.plan = protocol.stacks.at(index);
    stack.scanner_from_reference = stack_movement(anatomy.between_globes(), disturbances, index);
    stack.sigma = disturbances.snr > 0 ? reference_intensity / disturbances.snr : 0;
    stack.slices.resize(static_cast<std::size_t>(stack.plan.slices));
    return stack;
  }

  KSpace k_space(std::uint64_t seed) const {
    KSpace k_space;
    k_space.acquired_readout = plan_.acquired_readout;
    k_space.acquired_phase = plan_.acquired_phase;
    k_space.fat_shift_px = disturbances_.chemical_shift_px;
    k_space.sigma = stack_.sigma;
    k_space.window = disturbances_.window;
    k_space.noise_variation = disturbances_.noise_variation;
    k_space.echo_train = disturbances_.echo_train;
    k_space.ghost = disturbances_.ghost;
    k_space.seed = seed;
    return k_space;
  }

  /// The object under a slice, or under a layer of one.
  FineSlice sample(const StackPlan& plan, const Eigen::Isometry3d& moved, double slice, Points points) const {
    const Eigen::Vector3d first =
        stack_.position(-margin_x_, -margin_y_, 0) + slice * plan_.slice_spacing_mm * plan_.normal();
    const SlicePose pose{first, moved.inverse(), 1 + disturbances_.scale_error};
    return SliceSampler(anatomy_, plan, sensitivity_, pose, columns_, rows_, points.near_globe,
                        points.elsewhere)
        .sample();
  }

  void keep(int slice, const std::vector<float>& image) {
    std::vector<float>& out = stack_.slices[static_cast<std::size_t>(slice)];
    out.reserve(static_cast<std::size_t>(plan_.rows) * plan_.columns);
    for (int row = 0; row < plan_.rows; ++row) {
      const auto* begin = image.data() + static_cast<std::size_t>(row + margin_y_) * columns_ + margin_x_;
      out.insert(out.end(), begin, begin + plan_.columns);
    }
  }

  /// A slice that is excited on its own.
  void excite(int slice) {
    std::mt19937_64 random = slice_random(disturbances_.seed, index_, slice);
    const Eigen::Isometry3d moved = slice_movement(disturbances_, random) * stack_.scanner_from_reference;
    std::vector<float> image = magnitude_image(sample(plan_, moved, slice, through_slice), k_space(random()));
    if (disturbances_.slice_gain > 0) {
      const double gain = std::exp(std::normal_distribution<double>(0, disturbances_.slice_gain)(random));
      for (float& value : image) value *= static_cast<float>(gain);
    }
    keep(slice, image);
  }

  /// All slices, excited together: layers `fine` times thinner, then k-space's third direction. What moves or
  /// brightens one slice alone has no place here.
  void encode(const std::function<void()>& advance) {
    const int margin = margin_of(plan_.slices), slices = plan_.slices + 2 * margin;
    const SliceEncoding encoding(slices, disturbances_.window);
    StackPlan thin = plan_;
    thin.profile = SliceProfile::box;
    thin.slice_thickness_mm = plan_.slice_spacing_mm / fine;
    const std::size_t pixels = static_cast<std::size_t>(rows_) * columns_;
    const auto kept = static_cast<std::size_t>(plan_.slices);
    std::vector<ComplexImage> signal(kept, ComplexImage(pixels)), noise(kept, ComplexImage(pixels));
    const auto add = [&](ComplexImage& sum, const ComplexImage& image, double weight) {
      for (std::size_t i = 0; i < pixels; ++i) sum[i] += static_cast<float>(weight) * image[i];
    };
    // Some slices at a time, as all layers of a head are half a gigabyte.
    constexpr int slices_at_once = 8;
    for (int first = 0; first < slices; first += slices_at_once) {
      const int count = std::min(slices_at_once, slices - first);
      std::vector<ComplexImage> layer(static_cast<std::size_t>(fine * count)),
          own(static_cast<std::size_t>(count));
      on_threads(threads_, static_cast<std::size_t>(count), [&](std::size_t i) {
        const int slice = first + static_cast<int>(i);
        std::mt19937_64 random = slice_random(disturbances_.seed, index_, slice - margin);
        const KSpace of_slice = k_space(random());
        own[i] = noise_image(rows_, columns_, of_slice);
        for (int l = 0; l < fine; ++l)
          layer[fine * i + static_cast<std::size_t>(l)] =
              signal_image(sample(thin, stack_.scanner_from_reference,
                                  slice - margin + (l + 0.5) / fine - 0.5, through_layer),
                           of_slice);
        if (advance && slice >= margin && slice < margin + plan_.slices) advance();
      });
      on_threads(threads_, kept, [&](std::size_t to) {
        const int slice = margin + static_cast<int>(to);
        for (int l = 0; l < fine * count; ++l)
          add(signal[to], layer[static_cast<std::size_t>(l)], encoding.of_layer(slice, fine * first + l));
        for (int i = 0; i < count; ++i)
          add(noise[to], own[static_cast<std::size_t>(i)], encoding.of_noise(slice, first + i));
      });
    }
    for (std::size_t slice = 0; slice < kept; ++slice)
      keep(static_cast<int>(slice), magnitude_image(signal[slice], noise[slice]));
  }

  const Anatomy& anatomy_;
  const Disturbances& disturbances_;
  std::size_t index_;
  int threads_;
  RenderedStack stack_;
  const StackPlan& plan_;
  Sensitivity sensitivity_;
  int margin_x_, margin_y_, columns_, rows_;
};

}  // namespace

RenderedStack render(const Anatomy& anatomy, const Protocol& protocol, std::size_t index, int threads,
                     const std::function<void()>& advance) {
  return Renderer(anatomy, protocol, index, threads).render(advance);
}

}  // namespace emmetrope::phantom
