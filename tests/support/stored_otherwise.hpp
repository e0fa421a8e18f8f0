#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// How a file keeps the voxels of a stack: which of its axes (0 columns, 1 rows, 2 slices) becomes that of columns,
/// rows and slices, backward where negative (~axis), and how many voxels are cut off at each end of the stack's axes.
struct Storage {
  std::array<int, 3> axis{0, 1, 2};
  Eigen::Vector3i cropped = Eigen::Vector3i::Zero();
};

/// The same voxels in the same places, stored otherwise.
/// \pre slices are evenly apart, as thick as that, and not shifted within their plane
inline Stack stored_otherwise(const Stack& stack, const Storage& storage) {
  const Eigen::Vector3i whole(stack.columns, stack.rows, stack.slices());
  const auto axis_of = [&](std::size_t i) { return std::max(storage.axis[i], ~storage.axis[i]); };
  const auto count = [&](std::size_t i) { return whole[axis_of(i)] - 2 * storage.cropped[axis_of(i)]; };
  const auto voxel = [&](int column, int row, int slice) {
    const std::array<int, 3> index{column, row, slice};
    Eigen::Vector3i at;
    for (std::size_t i = 0; i < 3; ++i)
      at[axis_of(i)] =
          storage.cropped[axis_of(i)] + (storage.axis[i] < 0 ? count(i) - 1 - index[i] : index[i]);
    return at;
  };
  const auto place = [&](const Eigen::Vector3i& v) { return stack.position(v.x(), v.y(), v.z()); };
  const auto step = [&](int column, int row, int slice) -> Eigen::Vector3d {
    return place(voxel(column, row, slice)) - place(voxel(0, 0, 0));
  };
  const Eigen::Vector3d sigma_mm(stack.fat_shift_sigma_mm.x(), stack.fat_shift_sigma_mm.y(), 0);
  Stack other;
  other.name = stack.name;
  other.slices_are_told = stack.slices_are_told && axis_of(2) == 2;
  other.slices_are_encoded = stack.slices_are_encoded;
  other.columns = count(0);
  other.rows = count(1);
  other.column_spacing_mm = step(1, 0, 0).norm();
  other.row_spacing_mm = step(0, 1, 0).norm();
  other.slice_thickness_mm = step(0, 0, 1).norm();
  other.along_row = step(1, 0, 0).normalized();
  other.along_column = step(0, 1, 0).normalized();
  other.normal = other.along_row.cross(other.along_column);
  // What a file without a header's readout tells: one pixel along each axis.
  other.fat_shift_sigma_mm = sigma_mm.head<2>().minCoeff() > 0
                                 ? Eigen::Vector2d(other.column_spacing_mm, other.row_spacing_mm)
                                 : Eigen::Vector2d(sigma_mm[axis_of(0)], sigma_mm[axis_of(1)]);
  const bool reversed = step(0, 0, 1).dot(other.normal) < 0;  // slices are ordered along the normal
  for (int k = 0; k < count(2); ++k) {
    const int slice = reversed ? count(2) - 1 - k : k;
    other.slice_position.push_back(place(voxel(0, 0, slice)));
    std::vector<float>& values = other.slice_intensity.emplace_back();
    for (int row = 0; row < other.rows; ++row)
      for (int column = 0; column < other.columns; ++column) {
        const Eigen::Vector3i v = voxel(column, row, slice);
        values.push_back(stack.at(v.x(), v.y(), v.z()));
      }
  }
  return other;
}

/// The head in a mirror: its right eye is the left one.
inline Stack in_mirror(Stack stack) {
  for (Eigen::Vector3d* axis : {&stack.along_row, &stack.along_column}) axis->x() *= -1;
  for (Eigen::Vector3d& position : stack.slice_position) position.x() *= -1;
  // The normal of the mirrored axes runs the other way; slices are ordered along it.
  stack.normal = stack.along_row.cross(stack.along_column);
  std::reverse(stack.slice_position.begin(), stack.slice_position.end());
  std::reverse(stack.slice_intensity.begin(), stack.slice_intensity.end());
  return stack;
}

/// The same voxels in the same order, by their header turned about the patient's origin.
inline Stack turned_header(Stack stack, double by_rad, const Eigen::Vector3d& about) {
  const Eigen::AngleAxisd turn(by_rad, about);
  for (Eigen::Vector3d* axis : {&stack.along_row, &stack.along_column, &stack.normal}) *axis = turn * *axis;
  for (Eigen::Vector3d& position : stack.slice_position) position = turn * position;
  return stack;
}

}  // namespace emmetrope::segmentation
