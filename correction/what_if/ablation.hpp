#pragma once
#include <functional>

#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/model/eye_model.hpp"

/// Corneal refractive surgery.
namespace emmetrope::correction {

struct OpticalZone {
  double diameter_mm = 6;
  double transition_mm = 1;         ///< beyond it, down to the untouched cornea
  Eigen::Vector2d centre_mm{0, 0};  ///< from the corneal apex
};

/// The tissue that an ablation takes off the front cornea, as depth along the eye's axis: never negative, and
/// nothing anywhere beyond the transition.
class AblationProfile {
 public:
  /// \param shape_mm  depth over the zone, from its centre, up to a constant that is chosen so that the least
  ///   depth is 0
  AblationProfile(std::function<double(const Eigen::Vector2d&)> shape_mm, const OpticalZone& zone);

  double depth_mm(double x_mm, double y_mm) const;  ///< from the apex
  double central_depth_um() const { return 1e3 * depth_mm(zone_.centre_mm.x(), zone_.centre_mm.y()); }
  double deepest_um() const { return deepest_um_; }
  const OpticalZone& zone() const { return zone_; }

 private:
  std::function<double(const Eigen::Vector2d&)> shape_mm_;
  OpticalZone zone_;
  double shift_mm_ = 0, deepest_um_ = 0;
};

/// Munnerlyn, Koons and Marshall (1988), toric: the difference between spheres (in each meridian) of the old
/// and of the new curvature.
///
/// \param curvature_per_mm  of the front cornea at its apex, over eye x and y
/// \param correction  the refraction that it takes away, at the corneal vertex
/// \param index_step  of the cornea against air
/// \throw Error (no_result) when it would leave no convex cornea
AblationProfile munnerlyn_profile(const Eigen::Matrix2d& curvature_per_mm, const PowerVector& correction,
                                  double index_step, const OpticalZone& zone = {});
/// The same for an eye's front cornea.
AblationProfile munnerlyn_profile(const EyeModel& eye, const PowerVector& correction);

/// Guided by the eye's wavefront aberration W: depth is -W / (n - 1) over the zone about the line of sight,
/// so that all light from the retina leaves in step. Each further round adds what the operated eye still has.
///
/// \throw Error (no_result) when rays do not fill the zone, or too little cornea would be left
AblationProfile wavefront_guided_profile(const EyeModel& eye, double wavelength_nm,
                                         const Eigen::Vector2d& fovea_mm = {0, 0}, int rounds = 3);

/// The eye after it: its front cornea as a mesh (a formula becomes one first) whose vertices lie deeper by
/// the profile, with the normals turned along. The apex sinks too, which leaves the eye that much shorter.
/// \throw Error (no_result) when less than 0.25 mm of cornea would be left
EyeModel with_ablation(EyeModel eye, const AblationProfile& profile);

}  // namespace emmetrope::correction
