#pragma once
#include "pipeline/eye/optics/retina_point.hpp"
#include "pipeline/eye/optics/stop_crossing.hpp"

namespace emmetrope {

/// Exact rays through the centre of the stop, in both directions. Of an eye behind a spectacle only those that pass it:
/// beside its rim the field begins anew with a jump.
class ChiefRays {
 public:
  /// \throw Error (input_invalid) when the eye has no stop
  ChiefRays(const EyeModel& eye, double wavelength_nm);

  /// The line of sight of a retinal point, where it leaves the eye; nothing where it does not. Beyond 90 degrees
  /// from the axis it runs backward, z < 0.
  std::optional<Ray> line_of_sight(const Eigen::Vector3d& retina) const;
  /// Where the retina sees a direction; nothing where no ray from there comes to it.
  /// \param direction  from the eye towards what is seen
  std::optional<RetinaPoint> image_of(const Eigen::Vector3d& direction) const;

 private:
  struct FromDirection;
  /// From a first guess; nothing where Newton's method finds no ray through the stop's centre.
  std::optional<Eigen::Vector2d> shift_to_centre(const FromDirection& ray, Eigen::Vector2d shift_mm) const;

  /// Where a ray that enters the eye meets the retina.
  std::optional<RetinaPoint> met_on_retina(const Ray& ray_in_eye) const;

  bool passes_what_is_worn(const RayPath& path) const;

  EyeModel eye_;
  std::ptrdiff_t worn_surfaces_;
  StopCrossing crossing_;
  ExactTracer tracer_;  ///< without the stop
  double entrance_pupil_z_mm_, aim_plane_z_mm_;
};

}  // namespace emmetrope
