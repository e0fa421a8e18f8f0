#include "segmentation/finding/sampling.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/even_points.hpp"

namespace emmetrope::segmentation {

using Eigen::Vector3d;

/// One thin slice that is missing leaves no more than this, as thick slices have everywhere.
constexpr double gap_of_one_spacings = 2.2, gap_of_one_mm = 2.6;

Sampler::Sampler(const Stack& stack) : stack_(stack), spacing_mm_(stack.slice_spacing_mm()) {
  for (const Vector3d& position : stack.slice_position) depth_mm_.push_back(stack.normal.dot(position));
}

std::optional<Vector3d> Sampler::voxel_coordinates(const Vector3d& lps) const {
  if (depth_mm_.empty() || !lps.allFinite()) return std::nullopt;
  const double along = stack_.normal.dot(lps);
  std::size_t low = 0, high = depth_mm_.size() - 1;
  double slice = 0;
  if (along <= depth_mm_.front()) {
    if (depth_mm_.front() - along > spacing_mm_ / 2) return std::nullopt;
    high = 0;
  } else if (along >= depth_mm_.back()) {
    if (along - depth_mm_.back() > spacing_mm_ / 2) return std::nullopt;
    low = high;
    slice = static_cast<double>(high);
  } else {
    high = static_cast<std::size_t>(std::upper_bound(depth_mm_.begin(), depth_mm_.end(), along) -
                                    depth_mm_.begin());
    low = high - 1;
    const double gap = depth_mm_[high] - depth_mm_[low];
    if (gap > std::max(1.6 * spacing_mm_, std::min(gap_of_one_spacings * spacing_mm_, gap_of_one_mm)))
      return std::nullopt;
    slice = static_cast<double>(low) + (along - depth_mm_[low]) / gap;
  }
  // Slices may be shifted within their plane: the origin is interpolated as well.
  const double u = slice - static_cast<double>(low);
  const Vector3d origin = (1 - u) * stack_.slice_position[low] + u * stack_.slice_position[high];
  return Vector3d((lps - origin).dot(stack_.along_row) / stack_.column_spacing_mm,
                  (lps - origin).dot(stack_.along_column) / stack_.row_spacing_mm, slice);
}

std::optional<double> Sampler::interpolate(const Vector3d& lps) const {
  const auto at = voxel_coordinates(lps);
  if (!at) return std::nullopt;
  const int c = static_cast<int>(std::floor(at->x())), r = static_cast<int>(std::floor(at->y()));
  if (c < 0 || r < 0 || c + 1 >= stack_.columns || r + 1 >= stack_.rows) return std::nullopt;
  const int s0 = static_cast<int>(at->z()), s1 = std::min(s0 + 1, stack_.slices() - 1);
  const double u = at->x() - c, v = at->y() - r, w = at->z() - s0;
  const auto plane = [&](int s) {
    return (1 - v) * ((1 - u) * stack_.at(c, r, s) + u * stack_.at(c + 1, r, s)) +
           v * ((1 - u) * stack_.at(c, r + 1, s) + u * stack_.at(c + 1, r + 1, s));
  };
  return (1 - w) * plane(s0) + w * plane(s1);
}

void for_each_voxel_near(const Stack& stack, const Vector3d& centre, double radius_mm,
                         const std::function<void(int, int, int, const Vector3d&)>& visit) {
  for (int s = 0; s < stack.slices(); ++s) {
    const Vector3d to_centre = centre - stack.slice_position[s];
    const double off_plane = to_centre.dot(stack.normal);
    if (std::abs(off_plane) > radius_mm) continue;
    const double reach = std::sqrt(radius_mm * radius_mm - off_plane * off_plane);
    const double column = to_centre.dot(stack.along_row) / stack.column_spacing_mm;
    const double row = to_centre.dot(stack.along_column) / stack.row_spacing_mm;
    const int c0 = std::max(0, static_cast<int>(std::ceil(column - reach / stack.column_spacing_mm)));
    const int c1 =
        std::min(stack.columns - 1, static_cast<int>(std::floor(column + reach / stack.column_spacing_mm)));
    const int r0 = std::max(0, static_cast<int>(std::ceil(row - reach / stack.row_spacing_mm)));
    const int r1 = std::min(stack.rows - 1, static_cast<int>(std::floor(row + reach / stack.row_spacing_mm)));
    for (int r = r0; r <= r1; ++r) {
      for (int c = c0; c <= c1; ++c) {
        const Vector3d position = stack.position(c, r, s);
        if ((position - centre).squaredNorm() <= radius_mm * radius_mm) visit(c, r, s, position);
      }
    }
  }
}

Eigen::Matrix3d axes_of_voxels(const Stack& stack) {
  std::array<Vector3d, 3> axes_of{stack.along_row, stack.along_column, stack.normal};
  // Whichever order they are stored in: that nearest to up and down last, of the others that nearest to right and left
  // first.
  const auto is_less = [](int lps) {
    return [lps](const Vector3d& a, const Vector3d& b) { return std::abs(a[lps]) < std::abs(b[lps]); };
  };
  std::iter_swap(std::max_element(axes_of.begin(), axes_of.end(), is_less(2)), axes_of.end() - 1);
  std::iter_swap(std::max_element(axes_of.begin(), axes_of.end() - 1, is_less(0)), axes_of.begin());
  Eigen::Matrix3d axes;
  for (Eigen::Index lps = 0; lps < 3; ++lps) {
    const Vector3d& axis = axes_of[static_cast<std::size_t>(lps)];
    axes.col(lps) = axis[lps] < 0 ? Vector3d(-axis) : axis;
  }
  return axes;
}

std::array<Vector3d, 2> across(const Stack& stack, const Vector3d& direction) {
  const Eigen::Matrix3d axes = axes_of_voxels(stack);
  const Vector3d first = axes * Vector3d(axes.transpose() * direction).unitOrthogonal();
  return {first, direction.cross(first)};
}

std::vector<Vector3d> directions_along(const Stack& stack, int count) {
  const Eigen::Matrix3d axes = axes_of_voxels(stack);
  std::vector<Vector3d> directions = mirrored_directions(count);
  for (Vector3d& direction : directions) direction = axes * direction;
  return directions;
}

double quantile(std::vector<double>& values, double fraction) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace emmetrope::segmentation
