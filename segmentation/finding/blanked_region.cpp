#include "segmentation/finding/blanked_region.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/base/even_points.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Array3i;
using Eigen::Vector3d;

constexpr double middle_mm = 5;                              ///< of a globe
constexpr double nearest_fat_mm = 13, farthest_fat_mm = 16;  ///< from its centre, what lies around it

struct BlankShare {
  int voxels = 0, blank = 0;
  double share() const { return voxels == 0 ? 0 : static_cast<double>(blank) / voxels; }
};

/// What zero became where values were rescaled after the face was taken off: the lowest value, if it is also the
/// commonest (of evenly spaced voxels); else zero.
double blank_value_of(const Stack& stack) {
  constexpr std::size_t sampled = 10'000;
  const auto in_slice = static_cast<std::size_t>(stack.columns) * static_cast<std::size_t>(stack.rows);
  const std::size_t voxels = in_slice * static_cast<std::size_t>(stack.slices()),
                    stride = std::max<std::size_t>(1, voxels / sampled);
  std::vector<float> values;
  for (std::size_t i = 0; i < voxels; i += stride)
    values.push_back(stack.slice_intensity[i / in_slice][i % in_slice]);
  std::sort(values.begin(), values.end());
  const auto count_from = [&](auto first) { return std::upper_bound(first, values.end(), *first) - first; };
  for (auto first = values.begin(); first != values.end(); first += count_from(first))
    if (count_from(first) > count_from(values.begin())) return 0;
  return values.empty() ? 0 : values.front();
}

}  // namespace

bool BlankedRegion::is_blank_with_neighbours(const Stack& stack, int column, int row, int slice) const {
  for (int s = std::max(0, slice - 1); s <= std::min(stack.slices() - 1, slice + 1); ++s)
    for (int r = std::max(0, row - 1); r <= std::min(stack.rows - 1, row + 1); ++r)
      for (int c = std::max(0, column - 1); c <= std::min(stack.columns - 1, column + 1); ++c)
        if (!is_blank(stack.at(c, r, s))) return false;
  return true;
}

bool BlankedRegion::is_blank(double value) const {
  constexpr double rounding = 1e-6;  // of an interpolation among equal values
  return value == 0 || std::abs(value - value_) <= rounding * std::abs(value_);
}

BlankedRegion::BlankedRegion(const Stack& stack, const Vector3d& globe_centre, double radius_mm)
    : value_(blank_value_of(stack)) {
  Array3i first(stack.columns, stack.rows, stack.slices()), last = Array3i::Constant(-1);
  BlankShare middle, around;
  for_each_voxel_near(stack, globe_centre, radius_mm, [&](int c, int r, int s, const Vector3d& position) {
    first = first.min(Array3i(c, r, s));
    last = last.max(Array3i(c, r, s));
    const double distance = (position - globe_centre).norm();
    const bool is_around = distance >= nearest_fat_mm && distance <= farthest_fat_mm;
    if (distance > middle_mm && !is_around) return;
    BlankShare& part = is_around ? around : middle;
    ++part.voxels;
    part.blank += is_blank_with_neighbours(stack, c, r, s) ? 1 : 0;
  });
  // A face's plane through the eye takes as much of what lies around it.
  const bool is_dark_vitreous = middle.share() > 0.5 && around.share() < 1.0 / 3;
  if (is_dark_vitreous || (last < first).any()) return;
  find_cores(stack, first, last - first + 1);
}

BlankedRegion::BlankedRegion(const Stack& stack) : value_(blank_value_of(stack)) {
  find_cores(stack, Array3i::Zero(), {stack.columns, stack.rows, stack.slices()});
}

void BlankedRegion::find_cores(const Stack& stack, const Array3i& first, const Array3i& count) {
  first_ = first;
  count_ = count;
  core_.resize(static_cast<std::size_t>(count.prod()));
  const Array3i end = first + count;
  std::size_t i = 0;
  for (int s = first[2]; s < end[2]; ++s)
    for (int r = first[1]; r < end[1]; ++r)
      for (int c = first[0]; c < end[0]; ++c) core_[i++] = is_blank_with_neighbours(stack, c, r, s) ? 1 : 0;
}

bool BlankedRegion::is_core(const Array3i& voxel) const {
  const Array3i at = voxel - first_;
  if ((at < 0).any() || (at >= count_).any()) return false;
  const Eigen::Index place = (Eigen::Index{at[2]} * count_[1] + at[1]) * count_[0] + at[0];
  return core_[static_cast<std::size_t>(place)] != 0;
}

bool BlankedRegion::is_core_within(const Array3i& voxel, int reach) const {
  if (core_.empty()) return false;
  for (int s = -reach; s <= reach; ++s)
    for (int r = -reach; r <= reach; ++r)
      for (int c = -reach; c <= reach; ++c)
        if (is_core(voxel + Array3i(c, r, s))) return true;
  return false;
}

bool BlankedRegion::holds_voxel(int column, int row, int slice) const {
  // One voxel around the core is blank too, and the next may have been mixed with it when the image was resampled.
  return is_core_within({column, row, slice}, 2);
}

bool BlankedRegion::is_lost(const Sampler& stack, const Vector3d& lps) const {
  const auto at = stack.voxel_coordinates(lps);
  return at && is_core_within(at->array().round().cast<int>(), 1);
}

bool BlankedRegion::holds(const Sampler& stack, const Vector3d& lps) const {
  if (core_.empty()) return false;
  const auto at = stack.voxel_coordinates(lps);
  if (!at) return false;
  constexpr double within = 2 - 1e-9;  // voxels
  const Array3i low = (at->array() - within).ceil().cast<int>(),
                high = (at->array() + within).floor().cast<int>();
  for (int s = low[2]; s <= high[2]; ++s)
    for (int r = low[1]; r <= high[1]; ++r)
      for (int c = low[0]; c <= high[0]; ++c)
        if (is_core({c, r, s})) return true;
  return false;
}

bool BlankedRegion::holds_front(const Stack& stack, const Vector3d& globe_centre,
                                const Vector3d& axis) const {
  constexpr int points = 200;
  const Sampler sampler(stack);
  const auto share_lost = [&](double along_mm, double radius_mm) {
    int lost = 0;
    for (int i = 0; i < points; ++i)
      lost +=
          is_lost(sampler, globe_centre + along_mm * axis +
                               radius_mm * std::cbrt((i + 0.5) / points) * fibonacci_direction(i, points));
    return static_cast<double>(lost) / points;
  };
  if (core_.empty()) return false;
  return share_lost(8, 3.5) > 0.25 && share_lost(12.5, 1.5) > 0.8;
}

std::optional<double> BlankedRegion::share_cut_before(const Stack& stack, const Vector3d& apex,
                                                      const Vector3d& axis) const {
  constexpr double nearest_mm = 0.3, farthest_mm = 1.3, radius_mm = 2.5;
  constexpr int depths = 4, points = 50;
  const Sampler sampler(stack);
  const auto [aside, upright] = across(stack, axis);
  const auto place = [&, aside = aside, upright = upright](const Eigen::Vector2d& beside_mm,
                                                           double before_mm) -> Vector3d {
    return apex + before_mm * axis + beside_mm.x() * aside + beside_mm.y() * upright;
  };
  BlankShare before;
  for (int depth = 0; depth < depths; ++depth)
    for (int i = 0; i < points; ++i) {
      const Vector3d at = place(radius_mm * sunflower_point(i, points),
                                nearest_mm + (farthest_mm - nearest_mm) * depth / (depths - 1));
      if (!sampler.interpolate(at)) continue;
      ++before.voxels;
      before.blank += is_lost(sampler, at) ? 1 : 0;
    }
  if (2 * before.voxels < depths * points) return std::nullopt;

  // How far behind the apex the blank ends.
  constexpr double first_mm = -2, last_mm = 4, step_mm = 0.1;
  const auto end_of_blank_mm = [&](const Eigen::Vector2d& beside_mm) {
    double behind_mm = first_mm;
    while (behind_mm < last_mm && is_lost(sampler, place(beside_mm, -behind_mm))) behind_mm += step_mm;
    return behind_mm;
  };
  constexpr double beside_mm = 5, receding_mm = 1;
  constexpr int directions = 24;
  std::vector<double> around_mm;
  for (int i = 0; i < directions; ++i) {
    const double angle = 2 * pi * i / directions;
    around_mm.push_back(end_of_blank_mm(beside_mm * Eigen::Vector2d(std::cos(angle), std::sin(angle))));
  }
  // Lids cover a part of the ring.
  std::nth_element(around_mm.begin(), around_mm.begin() + 3 * directions / 4, around_mm.end());
  const bool is_plane = around_mm[3 * directions / 4] - end_of_blank_mm({0, 0}) < receding_mm;
  return is_plane ? before.share() : 0;
}

BlankedRegion blanked_front(const Stack& stack, const Vector3d& globe_centre, const Vector3d& axis,
                            double radius_mm) {
  BlankedRegion region(stack, globe_centre, radius_mm);
  return region.holds_front(stack, globe_centre, axis) ? region : BlankedRegion();
}

}  // namespace emmetrope::segmentation
