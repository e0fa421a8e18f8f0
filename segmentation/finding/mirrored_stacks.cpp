#include "segmentation/finding/mirrored_stacks.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>

#include "pipeline/base/error.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// From between the globes: x to the patient's left through both, z up.
Eigen::Isometry3d head_frame(const GlobePair& globes) {
  const Vector3d to_left = (globes.left - globes.right).normalized();
  const Vector3d up = (Vector3d::UnitZ() - to_left.z() * to_left).normalized();
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.linear() << to_left, up.cross(to_left), up;
  frame.translation() = (globes.right + globes.left) / 2;
  return frame;
}

constexpr int bins = 32;

/// Ranks in equal shares: brightness itself differs between contrasts and coils.
std::vector<int> binned(const std::vector<double>& values) {
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  std::vector<int> result;
  for (const double value : values) {
    const auto below = std::lower_bound(sorted.begin(), sorted.end(), value) - sorted.begin();
    result.push_back(static_cast<int>(bins * below / static_cast<std::ptrdiff_t>(sorted.size())));
  }
  return result;
}

double mutual_information(const std::vector<int>& one, const std::vector<int>& other) {
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(bins, bins);
  for (std::size_t i = 0; i < one.size(); ++i)
    joint(one[i], other[i]) += 1.0 / static_cast<double>(one.size());
  const Eigen::VectorXd of_one = joint.rowwise().sum();
  const Eigen::RowVectorXd of_other = joint.colwise().sum();
  double bits = 0;
  for (int i = 0; i < bins; ++i)
    for (int k = 0; k < bins; ++k)
      if (joint(i, k) > 0) bits += joint(i, k) * std::log2(joint(i, k) / (of_one[i] * of_other[k]));
  return bits;
}

}  // namespace

std::optional<CommonInformation> common_information(const Stack& one, const GlobePair& globes_of_one,
                                                    const Stack& other, const GlobePair& globes_of_other) {
  constexpr double step_mm = 2.5, aside_mm = 70, before_mm = 25, behind_mm = 90, up_mm = 45;
  constexpr std::size_t fewest = 5000;
  const Sampler of_one(one), of_other(other);
  const Eigen::Isometry3d frame = head_frame(globes_of_one), other_frame = head_frame(globes_of_other);
  std::vector<double> here, as_told, mirrored;
  for (double x = -aside_mm; x <= aside_mm; x += step_mm)
    for (double y = -before_mm; y <= behind_mm; y += step_mm)
      for (double z = -up_mm; z <= up_mm; z += step_mm) {
        const auto a = of_one.interpolate(frame * Vector3d(x, y, z)),
                   b = of_other.interpolate(other_frame * Vector3d(x, y, z)),
                   c = of_other.interpolate(other_frame * Vector3d(-x, y, z));
        if (!a || !b || !c) continue;
        here.push_back(*a);
        as_told.push_back(*b);
        mirrored.push_back(*c);
      }
  if (here.size() < fewest) return std::nullopt;
  const std::vector<int> shades = binned(here);
  return CommonInformation{mutual_information(shades, binned(as_told)),
                           mutual_information(shades, binned(mirrored))};
}

void require_no_mirrored_stack(const FoundEyes& found, const std::vector<const Stack*>& stacks) {
  constexpr double more_in_common = 1.1;
  std::map<std::size_t, std::map<Laterality, Vector3d>> globes;  // by stack
  for (const auto* eyes : {&found.eyes, &found.in_other_contrast})
    for (const FoundEye& eye : *eyes)
      for (const EyeView& view : eye.views) globes[view.stack][eye.laterality] = view.globe.centre;
  std::map<std::size_t, GlobePair> pairs;
  for (const auto& [stack, of_stack] : globes)
    if (of_stack.size() == 2) pairs[stack] = {of_stack.at(Laterality::od), of_stack.at(Laterality::os)};
  for (auto one = pairs.begin(); one != pairs.end(); ++one)
    for (auto other = std::next(one); other != pairs.end(); ++other) {
      const auto bits =
          common_information(*stacks[one->first], one->second, *stacks[other->first], other->second);
      if (!bits || bits->mirrored < more_in_common * bits->as_told) continue;
      throw input_error(
          fmt::format(
              "{} and {} show one head only if one of them is mirrored: left and right are exchanged in it",
              stacks[one->first]->name, stacks[other->first]->name),
          "find out which of them is wrong; --series uses other series only");
    }
}

}  // namespace emmetrope::segmentation
