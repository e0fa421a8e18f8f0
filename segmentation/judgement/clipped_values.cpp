#include "segmentation/judgement/clipped_values.hpp"

#include <algorithm>
#include <limits>
#include <vector>

#include "segmentation/finding/blanked_region.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

constexpr double about_mm = 16, vitreous_mm = 5;  ///< from the globe's centre
constexpr double lens_radius_mm = 3.5;            ///< inside any lens

/// Of a whole stack.
struct GreyRange {
  explicit GreyRange(const Stack& stack) {
    for (const std::vector<float>& slice : stack.slice_intensity)
      for (const float value : slice) {
        low = std::min(low, value);
        high = std::max(high, value);
      }
  }
  float low = std::numeric_limits<float>::infinity(), high = -low;
};

struct Count {
  int voxels = 0, lowest = 0, highest = 0;

  void add(float value, const GreyRange& range) {
    ++voxels;
    lowest += value == range.low ? 1 : 0;
    highest += value == range.high ? 1 : 0;
  }
  ClippedShare share_highest(const GreyRange& range) const { return share(highest, range.high); }
  ClippedShare share_of_either(const GreyRange& range) const {
    return lowest > highest ? share(lowest, range.low) : share_highest(range);
  }

 private:
  ClippedShare share(int clipped, double value) const {
    return {voxels == 0 ? 0 : static_cast<double>(clipped) / voxels, value};
  }
};

void keep_larger(ClippedShare& largest, const ClippedShare& other) {
  if (other.share > largest.share) largest = other;
}

}  // namespace

ClippedValues clipped_values(const EyeFit& fit) {
  ClippedValues clipped;
  if (fit.evidence == Evidence::labels) return clipped;
  const double half_thickness_mm = fit.value(lens_thickness) / 2;
  const Vector3d lens_centre(0, 0, -fit.value(anterior_chamber_depth) - half_thickness_mm),
      lens_half_axes_mm(lens_radius_mm, lens_radius_mm, half_thickness_mm);
  const ForwardModel::AtParameters at(fit.model, fit.parameters);
  for (std::size_t k = 0; k < fit.stacks.size(); ++k) {
    const Stack& stack = *fit.stacks[k].stack;
    const Vector3d centre = fit.globe_centre_lps() - fit.head_shift_lps(k);
    const BlankedRegion blanked(stack, centre, about_mm);
    const GreyRange range(stack);
    Count about, lens;
    for_each_voxel_near(stack, centre, about_mm, [&](int c, int r, int s, const Vector3d& position) {
      if (blanked.holds_voxel(c, r, s)) return;
      const float value = stack.at(c, r, s);
      about.add(value, range);
      const Vector3d in_eye = at.to_eye(position, static_cast<int>(k));
      if ((in_eye - lens_centre).cwiseQuotient(lens_half_axes_mm).norm() < 1) lens.add(value, range);
    });
    keep_larger(clipped.about_eye, about.share_highest(range));
    keep_larger(clipped.lens, lens.share_of_either(range));
    keep_larger(clipped.vitreous, clipped_vitreous(stack, centre));
  }
  return clipped;
}

ClippedShare clipped_vitreous(const Stack& stack, const Vector3d& globe_centre_lps) {
  const BlankedRegion blanked(stack, globe_centre_lps, about_mm);
  const GreyRange range(stack);
  Count vitreous;
  for_each_voxel_near(stack, globe_centre_lps, vitreous_mm, [&](int c, int r, int s, const Vector3d&) {
    if (!blanked.holds_voxel(c, r, s)) vitreous.add(stack.at(c, r, s), range);
  });
  return vitreous.share_of_either(range);
}

}  // namespace emmetrope::segmentation
