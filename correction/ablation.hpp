#pragma once
#include "pipeline/base/power_vector.hpp"
#include "raytrace/eye/eye_model.hpp"

/// Corneal refractive surgery.
namespace emmetrope::correction {

/// The tissue that Munnerlyn, Koons and Marshall (1988) take off, toric: the difference between spheres (in
/// each meridian) of the old and of the new curvature over the optical zone, shifted so that nothing is added
/// anywhere, then smoothly down to nothing over the transition.
class MunnerlynProfile {
 public:
  /// \param curvature_per_mm  of the front cornea at its apex, over eye x and y
  /// \param correction        the refraction that it takes away, at the corneal vertex
  /// \param index_step        of the cornea against air
  /// \throw Error (no_result) when it would leave no convex cornea
  MunnerlynProfile(const Eigen::Matrix2d& curvature_per_mm, const PowerVector& correction, double index_step,
                   double optical_zone_mm = 6, double transition_mm = 1);

  double depth_mm(double x_mm, double y_mm) const;
  double central_depth_um() const { return 1e3 * depth_mm(0, 0); }
  double deepest_um() const;
  const Eigen::Matrix2d& new_curvature_per_mm() const { return after_; }
  double optical_zone_mm() const { return 2 * radius_mm_; }

 private:
  double unshifted_mm(double x_mm, double y_mm) const;

  Eigen::Matrix2d before_, after_;
  double radius_mm_, transition_mm_, shift_mm_ = 0;
};

/// The profile for an eye's front cornea.
MunnerlynProfile munnerlyn_profile(const EyeModel& eye, const PowerVector& correction);

/// The eye after it. A front cornea that is a mesh loses the profile's depth at each vertex, with the normals
/// turned along; one that is a formula becomes the biconic of the new curvature with its old asphericity.
/// Either apex lies deeper by the profile's depth there, which leaves the eye that much shorter.
EyeModel with_ablation(EyeModel eye, const MunnerlynProfile& profile);

}  // namespace emmetrope::correction
