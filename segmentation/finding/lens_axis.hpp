#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "segmentation/intake/volume.hpp"
#include "segmentation/intake/weighting.hpp"

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

/// Angle of a unit vector out of the eye with the direction in which the header has the face.
double from_ahead_deg(const Eigen::Vector3d& axis_lps);

/// Searches within 60 degrees of straight ahead, which is the answer where a lens there was blanked in the images.
LensAxis find_lens_axis(const std::vector<GlobeInStack>& views, double globe_radius_mm, Weighting weighting);

/// The direction of a lens farther than that from straight ahead, if it is told clearly: by a contrast of 0.2, twice that
/// of any direction 45 degrees from it. Chosen on 24 heads, in which eyes look 36 degrees away at most, and on eleven of
/// them with headers turned by 90 and 180 degrees.
std::optional<Eigen::Vector3d> find_lens_elsewhere(const std::vector<GlobeInStack>& views,
                                                   double globe_radius_mm, Weighting weighting);

}  // namespace emmetrope::segmentation
