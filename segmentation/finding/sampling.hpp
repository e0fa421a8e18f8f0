#pragma once
#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Column, row and slice coordinates (fractional) of a point; the slice coordinate interpolates the slices'
/// own positions along the normal and is absent outside the stack or in a gap wider than 1.6 spacings, but
/// for that of one missing slice up to 2.6 mm.
std::optional<Eigen::Vector3d> voxel_coordinates(const Stack& stack, const Eigen::Vector3d& lps);

/// Trilinear interpolation; absent outside the stack or inside a gap.
std::optional<double> interpolate(const Stack& stack, const Eigen::Vector3d& lps);

/// Calls `visit(column, row, slice, position)` for each voxel with its centre within `radius_mm` of `centre`.
void for_each_voxel_near(const Stack& stack, const Eigen::Vector3d& centre, double radius_mm,
                         const std::function<void(int, int, int, const Eigen::Vector3d&)>& visit);

/// The value below which this fraction of the values lies; 0 for none. Reorders them.
double quantile(std::vector<double>& values, double fraction);

}  // namespace emmetrope::segmentation
