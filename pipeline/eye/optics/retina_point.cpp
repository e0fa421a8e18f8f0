#include "pipeline/eye/optics/retina_point.hpp"

namespace emmetrope {

std::optional<RetinaPoint> meet_retina(const EyeModel& eye, const Eigen::Vector2d& from_pole_mm) {
  const Surface& retina = eye.retina();
  const Eigen::Isometry3d eye_from_surface = retina.eye_from_surface(),
                          surface_from_eye = eye_from_surface.inverse();
  const Eigen::Vector3d inside(from_pole_mm.x(), from_pole_mm.y(), -0.7 * eye.axial_length_mm());
  const std::optional<ShapeHit> hit = retina.shape->intersect(
      {surface_from_eye * inside, surface_from_eye.linear() * Eigen::Vector3d(0, 0, -1)});
  if (!hit) return std::nullopt;
  return RetinaPoint{eye_from_surface * hit->position, eye_from_surface.linear() * hit->normal};
}

}  // namespace emmetrope
