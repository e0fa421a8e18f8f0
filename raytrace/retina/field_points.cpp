#include "raytrace/retina/field_points.hpp"

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/retina/retina_arc.hpp"

namespace emmetrope::raytrace {

Eigen::Vector2d half_of(const RetinalGrid& grid) {
  switch (grid.projection) {
    case Projection::retina_plane:
    case Projection::retina_arc:
      return {0.5 * grid.field_x_mm, 0.5 * grid.field_y_mm};
    case Projection::visual_angle:
      return 0.5 * grid.field_deg;
    case Projection::perspective:
      return {std::tan(0.5 * grid.field_deg.x() * degree), std::tan(0.5 * grid.field_deg.y() * degree)};
  }
  return {0, 0};
}

FieldPoints::FieldPoints(const EyeModel& eye, const RetinalGrid& grid, double wavelength_nm)
    : eye_(eye),
      grid_(grid),
      chief_rays_(eye, wavelength_nm),
      centre_mm_(grid.centre_mm),
      eye_from_field_(Eigen::Matrix3d::Identity()) {
  if (grid.projection == Projection::retina_plane) return;
  const RetinaPoint centre = retina_point(eye, grid.centre_mm.x(), grid.centre_mm.y());
  if (grid.projection == Projection::retina_arc) {
    centre_mm_ = retina_arc_mm(eye, centre.position_mm).value_or(0) * grid.centre_mm.stableNormalized();
    return;
  }
  const std::optional<Ray> line_of_sight = chief_rays_.line_of_sight(centre.position_mm);
  if (!line_of_sight)
    throw input_error(
        "eye \"" + eye.name + "\": no ray from the field's centre through the stop leaves the eye",
        "use another --fovea, or look with emmetrope ray where rays end");
  eye_from_field_ = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), line_of_sight->direction)
                        .toRotationMatrix();
}

Eigen::Vector3d FieldPoints::direction(const Eigen::Vector2d& place) const {
  // The retinal image is upside down: what is seen to the right and below lies at eye -x and -y.
  if (grid_.projection == Projection::perspective)
    return eye_from_field_ * Eigen::Vector3d(-place.x(), -place.y(), 1).normalized();
  const double angle = place.norm() * degree;
  const Eigen::Vector2d beside =
      angle > 0 ? Eigen::Vector2d(-std::sin(angle) * place.normalized()) : Eigen::Vector2d(0, 0);
  return eye_from_field_ * Eigen::Vector3d(beside.x(), beside.y(), std::cos(angle));
}

std::optional<RetinaPoint> FieldPoints::at(const Eigen::Vector2d& place) const {
  if (grid_.is_angular()) return chief_rays_.image_of(direction(place));
  const Eigen::Vector2d from_pole_mm = centre_mm_ + place;
  std::optional<RetinaPoint> point = grid_.projection == Projection::retina_arc
                                         ? retina_at_arc(eye_, from_pole_mm)
                                         : meet_retina(eye_, from_pole_mm);
  if (!point || !chief_rays_.line_of_sight(point->position_mm)) return std::nullopt;
  return point;
}

}  // namespace emmetrope::raytrace
