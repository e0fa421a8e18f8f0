#pragma once
#include <optional>

#include "pipeline/eye/optics/chief_ray.hpp"
#include "raytrace/picture/trace_settings.hpp"

namespace emmetrope::raytrace {

/// Half the picture's width and height as places (below).
Eigen::Vector2d half_of(const RetinalGrid& grid);

/// Which point of the retina a place of the picture is, in every projection.
///
/// Places are counted from the picture's centre, x rightward and y downward as the patient perceives it, in the
/// units in which pixels are equidistant: mm on the retina, degrees (visual_angle) or tangents (perspective).
class FieldPoints {
 public:
  /// \pre the eye outlives this
  /// \throw Error (input_invalid) when the eye has no stop, or nothing is seen from the field's centre
  FieldPoints(const EyeModel& eye, const RetinalGrid& grid, double wavelength_nm);

  /// Nothing where the retina has no such point, or where no ray through the stop's centre leaves the eye from
  /// there.
  std::optional<RetinaPoint> at(const Eigen::Vector2d& place) const;
  /// The direction that a place looks in, from the eye towards the scene; of the angular projections.
  Eigen::Vector3d direction(const Eigen::Vector2d& place) const;

 private:
  const EyeModel& eye_;
  RetinalGrid grid_;
  ChiefRays chief_rays_;
  Eigen::Vector2d centre_mm_;       ///< from the pole, as the projection counts
  Eigen::Matrix3d eye_from_field_;  ///< turns +z to the line of sight of the field's centre
};

}  // namespace emmetrope::raytrace
