#pragma once
#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Reads a stack, which must outlive it, between its voxels.
class Sampler {
 public:
  explicit Sampler(const Stack& stack);
  explicit Sampler(Stack&&) = delete;

  /// Column, row and slice coordinates (fractional) of a point; the slice coordinate interpolates the slices'
  /// own positions along the normal and is absent outside the stack or in a gap wider than 1.6 spacings, but
  /// for that of one missing slice up to 2.6 mm.
  std::optional<Eigen::Vector3d> voxel_coordinates(const Eigen::Vector3d& lps) const;

  /// Trilinear interpolation; absent outside the stack or inside a gap.
  std::optional<double> interpolate(const Eigen::Vector3d& lps) const;

  const Stack& stack() const { return stack_; }

 private:
  const Stack& stack_;
  std::vector<double> depth_mm_;  ///< of the slices, along the normal
  double spacing_mm_;
};

/// Calls `visit(column, row, slice, position)` for each voxel with its centre within `radius_mm` of `centre`.
void for_each_voxel_near(const Stack& stack, const Eigen::Vector3d& centre, double radius_mm,
                         const std::function<void(int, int, int, const Eigen::Vector3d&)>& visit);

/// Columns: the stack's axes that lie nearest to the patient's left, back and top, in whatever order and direction they
/// are stored. What is sampled along them is the same voxels' in a header turned a little.
Eigen::Matrix3d axes_of_voxels(const Stack& stack);

/// Two directions across one, at right angles: the same in voxels whose header is turned a little.
std::array<Eigen::Vector3d, 2> across(const Stack& stack, const Eigen::Vector3d& direction);

/// About `count` directions, even over the sphere, along the stack's axes in whatever order they are stored: in a mirrored
/// stack the mirrored ones, in one turned a little, so that each axis stays the nearest to up or to the right, the turned
/// ones.
std::vector<Eigen::Vector3d> directions_along(const Stack& stack, int count);

/// The value below which this fraction of the values lies; 0 for none. Reorders them.
double quantile(std::vector<double>& values, double fraction);

}  // namespace emmetrope::segmentation
