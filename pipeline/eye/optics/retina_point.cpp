#include "pipeline/eye/optics/retina_point.hpp"

#include <algorithm>
#include <cmath>

namespace emmetrope {
namespace {

/// In the retina's own frame: by its depth where it stands upright, which is quick.
std::optional<RetinaPoint> at_depth(const Shape& shape, const Eigen::Vector2d& at) {
  const std::optional<double> depth = shape.depth_mm(at.x(), at.y());
  const std::optional<Eigen::Vector3d> normal = depth ? shape.normal(at.x(), at.y()) : std::nullopt;
  if (!normal) return std::nullopt;
  return RetinaPoint{{at.x(), at.y(), -*depth}, *normal};
}

/// Met from the depth of the centre of curvature, so that the sheet in front of the equator is out of the way.
std::optional<RetinaPoint> met_from_inside(const Surface& retina, const Eigen::Vector2d& from_pole_mm) {
  const double radius_mm = 2 / std::abs(retina.shape->vertex_curvature().trace());  // a plane's is infinite
  const double before_pole_mm = std::min(radius_mm, 0.7 * retina.position_mm);
  const Eigen::Isometry3d surface_from_eye = retina.eye_from_surface().inverse();
  const Eigen::Vector3d inside(from_pole_mm.x(), from_pole_mm.y(), before_pole_mm - retina.position_mm);
  const std::optional<ShapeHit> hit = retina.shape->intersect(
      {surface_from_eye * inside, surface_from_eye.linear() * Eigen::Vector3d(0, 0, -1)});
  if (!hit) return std::nullopt;
  return RetinaPoint{hit->position, hit->normal};
}

}  // namespace

std::optional<RetinaPoint> meet_retina(const EyeModel& eye, const Eigen::Vector2d& from_pole_mm) {
  const Surface& retina = eye.retina();
  const Eigen::Isometry3d eye_from_surface = retina.eye_from_surface();
  const bool upright = eye_from_surface.linear().isIdentity(1e-14);
  const std::optional<RetinaPoint> point =
      upright ? at_depth(*retina.shape, from_pole_mm - eye_from_surface.translation().head<2>())
              : met_from_inside(retina, from_pole_mm);
  if (!point) return std::nullopt;
  const double beside_axis_mm = point->position_mm.head<2>().norm();
  if (retina.semi_diameter_mm > 0 && beside_axis_mm > retina.semi_diameter_mm) return std::nullopt;
  return RetinaPoint{eye_from_surface * point->position_mm, eye_from_surface.linear() * point->normal};
}

}  // namespace emmetrope
