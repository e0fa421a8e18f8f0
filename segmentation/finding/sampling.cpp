#include "segmentation/finding/sampling.hpp"

#include <algorithm>
#include <cmath>

namespace emmetrope::segmentation {

using Eigen::Vector3d;

/// One thin slice that is missing leaves no more than this, as thick slices have everywhere.
constexpr double gap_of_one_spacings = 2.2, gap_of_one_mm = 2.6;

std::optional<Vector3d> voxel_coordinates(const Stack& stack, const Vector3d& lps) {
  if (stack.slices() == 0) return std::nullopt;
  const double along = stack.normal.dot(lps);
  const auto depth = [&](int k) { return stack.normal.dot(stack.slice_position[k]); };
  const double spacing = stack.slices() > 1 ? stack.slice_spacing_mm() : stack.slice_thickness_mm;
  int low = 0, high = stack.slices() - 1;
  double slice = 0;
  if (along <= depth(0)) {
    if (depth(0) - along > spacing / 2) return std::nullopt;
    high = 0;
  } else if (along >= depth(high)) {
    if (along - depth(high) > spacing / 2) return std::nullopt;
    low = high;
    slice = high;
  } else {
    while (high - low > 1) {
      const int middle = (low + high) / 2;
      (depth(middle) <= along ? low : high) = middle;
    }
    const double gap = depth(high) - depth(low);
    if (gap > std::max(1.6 * spacing, std::min(gap_of_one_spacings * spacing, gap_of_one_mm)))
      return std::nullopt;
    slice = low + (along - depth(low)) / gap;
  }
  // Slices may be shifted within their plane: the origin is interpolated as well.
  const double u = slice - low;
  const Vector3d origin = (1 - u) * stack.slice_position[low] + u * stack.slice_position[high];
  return Vector3d((lps - origin).dot(stack.along_row) / stack.column_spacing_mm,
                  (lps - origin).dot(stack.along_column) / stack.row_spacing_mm, slice);
}

std::optional<double> interpolate(const Stack& stack, const Vector3d& lps) {
  const auto at = voxel_coordinates(stack, lps);
  if (!at) return std::nullopt;
  const int c = static_cast<int>(std::floor(at->x())), r = static_cast<int>(std::floor(at->y()));
  if (c < 0 || r < 0 || c + 1 >= stack.columns || r + 1 >= stack.rows) return std::nullopt;
  const int s0 = static_cast<int>(at->z()), s1 = std::min(s0 + 1, stack.slices() - 1);
  const double u = at->x() - c, v = at->y() - r, w = at->z() - s0;
  const auto plane = [&](int s) {
    return (1 - v) * ((1 - u) * stack.at(c, r, s) + u * stack.at(c + 1, r, s)) +
           v * ((1 - u) * stack.at(c, r + 1, s) + u * stack.at(c + 1, r + 1, s));
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

double quantile(std::vector<double>& values, double fraction) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace emmetrope::segmentation
