#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "segmentation/finding/weighting.hpp"
#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Direction in which an eye looks, from the lens: darker than vitreous and aqueous in T2, brighter in T1.
struct LensAxis {
  Eigen::Vector3d axis;  ///< unit, out of the eye, LPS
  /// of the lens against its surroundings, relative to the vitreous (T2) or the surround (T1)
  double lens_contrast = 0;
  /// In T1 the globe was found by the edge of the fat, which chemical shift displaces: the axis if the lens
  /// is up to 2 mm nearer or farther than usual, where that is more than 10 degrees away.
  std::optional<Eigen::Vector3d> other_axis = {};
};
struct GlobeInStack {
  const Stack* stack = nullptr;
  Eigen::Vector3d centre;
};

/// Searches within 60 degrees of straight ahead, which is the answer where a lens there was blanked in the images.
LensAxis find_lens_axis(const std::vector<GlobeInStack>& views, double globe_radius_mm, Weighting weighting);

/// The direction of a lens that is told at least twice as clearly as any other, where it lies more than 50 degrees from
/// straight ahead: no eye looks so far away in a scanner (36 degrees at most in 24 heads).
std::optional<Eigen::Vector3d> find_lens_elsewhere(const std::vector<GlobeInStack>& views,
                                                   double globe_radius_mm, Weighting weighting);

}  // namespace emmetrope::segmentation
