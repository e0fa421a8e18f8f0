#include "segmentation/fit/residual_judgement.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/block_variance.hpp"
#include "segmentation/fit/eye_distances.hpp"
#include "segmentation/fit/slice_displacement.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Voxels per independent residual in each part, from the correlation of neighbours in the plane (as of a
/// first-order process).
std::array<double, part_count> residual_correlation(const EyeFit& fit, const std::vector<Sample>& samples,
                                                    const std::vector<double>& weighted) {
  using Place = std::array<long, 4>;
  std::map<Place, std::size_t> at;
  const auto place = [&](const Sample& sample) -> Place {
    const Stack& stack = *fit.stacks[sample.stack].stack;
    const Vector3d d = sample.position - stack.slice_position.front();
    return {sample.stack, std::lround(100 * d.dot(stack.normal)),
            std::lround(d.dot(stack.along_row) / stack.column_spacing_mm),
            std::lround(d.dot(stack.along_column) / stack.row_spacing_mm)};
  };
  std::array<double, part_count> power{}, voxels{};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto part = static_cast<std::size_t>(samples[i].part);
    at[place(samples[i])] = i;
    power[part] += weighted[i] * weighted[i];
    ++voxels[part];
  }
  std::array<std::array<double, 2>, part_count> along{}, pairs{};
  for (const auto& [key, i] : at) {
    for (const int axis : {0, 1}) {
      Place neighbour = key;
      ++neighbour[2 + axis];
      const auto found = at.find(neighbour);
      if (found == at.end() || samples[found->second].part != samples[i].part) continue;
      const auto part = static_cast<std::size_t>(samples[i].part);
      along[part][axis] += weighted[i] * weighted[found->second];
      ++pairs[part][axis];
    }
  }
  std::array<double, part_count> factor{};
  for (std::size_t part = 0; part < part_count; ++part) {
    factor[part] = 1;
    if (voxels[part] < 50) continue;
    for (const int axis : {0, 1}) {
      factor[part] *= voxels_per_independent(
          along[part][axis] / std::max(1.0, pairs[part][axis]) / (power[part] / voxels[part]),
          pairs[part][axis]);
    }
  }
  return factor;
}

/// The patch of each sample: rings about the eye's axis as seen from the globe's centre, cut into pieces
/// about as long as they are wide, alike on both sides of the vertical.
Blocks patches(const EyeFit& fit, const std::vector<Sample>& samples) {
  constexpr double width_rad = 30 * degree;
  const ForwardModel::AtParameters at(fit.model, fit.parameters);
  const Vector3d centre(0, 0, fit.value(globe_z) - fit.value(axial_length));
  std::map<std::pair<int, int>, int> number;
  Blocks blocks;
  for (const Sample& sample : samples) {
    const Vector3d p = at.to_eye(sample.position, sample.stack) - centre;
    const int ring = static_cast<int>(std::atan2(p.head<2>().norm(), -p.z()) / width_rad);
    const double pieces = std::max(1.0, std::round(2 * pi * std::sin((ring + 0.5) * width_rad) / width_rad));
    const int piece = static_cast<int>(std::floor((std::atan2(p.x(), p.y()) / (2 * pi) + 0.5) * pieces));
    blocks.push_back(number.try_emplace({ring, piece}, static_cast<int>(number.size())).first->second);
  }
  return blocks;
}

/// In T1 displaced fat outshines the wall that it lies over, and what of it is muscle, which stays, is known
/// roughly: the interface is off by this share of the displacement, mean errors of length, width and height
/// in phantoms, rms (docs/evidence/accuracy.md). A stated model error.
constexpr double interface_error_by_displacement = 0.06;
/// How wrong the place of an interface may be, in pixels, for what the model does not have, muscle off the
/// wall and the ringing of edges farther away: mean errors of length, width and height in phantoms, rms
/// (docs/evidence/accuracy.md). On the step of 0.16 of fat's signal from vitreous to wall; in T2 that is five times as
/// high.
constexpr double ringing_error_by_pixel = 0.025;

}  // namespace

double voxels_per_independent(double correlation, double pairs) {
  if (correlation <= 0) return 1;
  const double beyond_chance = std::clamp(correlation - 1 / (pairs * correlation), 0.0, 0.67);
  return (1 + beyond_chance) / (1 - beyond_chance);
}

std::array<double, part_count> judge_residuals(EyeFit& fit, const FitProblem& problem) {
  const ForwardModel::AtParameters at(fit.model, fit.parameters);
  fit.regions.assign(part_count, {});
  fit.residuals.clear();
  std::array<double, part_count> widening{};
  std::vector<double> weighted;
  double sum = 0;
  for (const Sample& sample : problem.samples) {
    const double w = residual(problem, at, sample), r = w * fit.misfit[sample.stack];
    const auto part = static_cast<std::size_t>(sample.part);
    fit.residuals.push_back(r);
    // Outliers count as the loss counts them.
    const double bounded = std::clamp(w, -4.0, 4.0);
    weighted.push_back(bounded);
    widening[part] += bounded * bounded;
    RegionFit& region = fit.regions[part];
    ++region.voxels;
    region.chi2 += r * r;
    region.outliers += std::abs(w) > 4 ? 1 : 0;
    sum += r * r;
  }
  fit.chi2_per_voxel = sum / std::max<double>(1, static_cast<double>(problem.samples.size()));
  const std::array<double, part_count> correlation = residual_correlation(fit, problem.samples, weighted);
  for (std::size_t part = 0; part < part_count; ++part) {
    RegionFit& region = fit.regions[part];
    const int voxels = std::max(1, region.voxels);
    region.name = part_names[part];
    region.chi2 /= voxels;
    region.outliers /= voxels;
    region.correlation = correlation[part];
    widening[part] = std::max(1.0, widening[part] / voxels) * correlation[part];
  }
  return widening;
}

Eigen::MatrixXd widened_for_coherent_residuals(const EyeFit& fit, const FitProblem& problem) {
  const LinearRows rows =
      linearise(problem, fit.parameters, select_parameters(fit.layout.size(), fit.active));
  return widened_for_blocks(rows, fit.covariance, slices_of(fit, problem.samples),
                            patches(fit, problem.samples), distance_derivatives(fit));
}

Eigen::MatrixXd widened_for_faint_wall(const EyeFit& fit) {
  if (fit.weighting != Weighting::t1 || fit.evidence == Evidence::labels) return fit.covariance;
  double displacement2 = 0, pixel2 = 0;
  for (int s = 0; s < fit.layout.stacks; ++s) {
    displacement2 +=
        fit.parameters.segment<2>(fit.layout.stack(s) + fat_shift_first).squaredNorm() / fit.layout.stacks;
    const StackSampling& stack = fit.model.stacks()[static_cast<std::size_t>(s)];
    pixel2 +=
        std::pow(0.5 / std::min(stack.row_cutoff_per_mm, stack.column_cutoff_per_mm), 2) / fit.layout.stacks;
  }
  const Eigen::MatrixXd figures =
      distance_derivatives(fit)(Eigen::all, {pole_depth, globe_width, globe_height});
  const Eigen::Array3d interfaces(1, 2, 2);  // that end each of them
  const Eigen::Array3d variance = std::pow(interface_error_by_displacement, 2) * displacement2 +
                                  interfaces.square() * std::pow(ringing_error_by_pixel, 2) * pixel2;
  const Eigen::MatrixXd error =
      figures * (figures.transpose() * figures).inverse() * variance.sqrt().matrix().asDiagonal();
  return fit.covariance + error * error.transpose();
}

}  // namespace emmetrope::segmentation
