#include "pipeline/eye/optics/retina_point.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope {
namespace {

/// In the retina's own frame: by its depth where it stands upright, which is quick.
std::optional<RetinaPoint> at_depth(const Shape& shape, const Eigen::Vector2d& at) {
  const std::optional<double> depth = shape.depth_mm(at.x(), at.y());
  const std::optional<Eigen::Vector3d> normal = depth ? shape.normal(at.x(), at.y()) : std::nullopt;
  if (!normal) return std::nullopt;
  return RetinaPoint{{at.x(), at.y(), -*depth}, *normal};
}

/// How deep the retina's centre lies.
double centre_depth_mm(const Surface& retina) {
  const double radius_mm = 2 / std::abs(retina.shape->vertex_curvature().trace());  // a plane's is infinite
  return retina.position_mm - std::min(radius_mm, 0.7 * retina.position_mm);
}

Ray in_frame_of(const Surface& retina, const Ray& ray) {
  const Eigen::Isometry3d surface_from_eye = retina.eye_from_surface().inverse();
  return {surface_from_eye * ray.origin, surface_from_eye.linear() * ray.direction};
}

/// Met from the depth of the centre of curvature, so that the sheet in front of the equator is out of the way.
std::optional<RetinaPoint> met_from_inside(const Surface& retina, const Eigen::Vector2d& from_pole_mm) {
  const Eigen::Vector3d inside(from_pole_mm.x(), from_pole_mm.y(), -centre_depth_mm(retina));
  const std::optional<ShapeHit> hit = retina.shape->intersect(in_frame_of(retina, {inside, {0, 0, -1}}));
  if (!hit) return std::nullopt;
  return RetinaPoint{hit->position, hit->normal};
}

/// c_x x^2 + c_y y^2 + c_z z^2 + 2 z = 0 with the frame's x turned by axis_deg about z: a whole ellipsoid.
struct Whole {
  Eigen::Vector3d c_per_mm;
  double axis_deg = 0;
};

/// Nothing for forms that are not closed.
std::optional<Whole> whole_of(const SurfaceFormula& formula) {
  if (const auto* sphere = std::get_if<SphereFormula>(&formula))
    return Whole{Eigen::Vector3d::Constant(1 / sphere->radius_mm)};
  if (const auto* conic = std::get_if<ConicFormula>(&formula)) {
    if (!(conic->q > -1)) return std::nullopt;
    return Whole{Eigen::Vector3d(1, 1, 1 + conic->q) / conic->radius_mm};
  }
  if (const auto* ellipsoid = std::get_if<EllipsoidFormula>(&formula)) {
    const Eigen::Vector3d& axes = ellipsoid->semi_axes_mm;
    return Whole{axes.z() * axes.cwiseProduct(axes).cwiseInverse(), ellipsoid->axis_deg};
  }
  return std::nullopt;
}

/// Where a ray from inside leaves it; the normal is turned inward.
std::optional<RetinaPoint> left_at(const Whole& whole, const Ray& ray) {
  const Eigen::AngleAxisd turn(-whole.axis_deg * degree, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d o = turn * ray.origin, v = turn * ray.direction;
  const Eigen::Vector3d& c = whole.c_per_mm;
  const double a = v.dot(c.cwiseProduct(v)), g = v.z() + v.dot(c.cwiseProduct(o)),
               f = o.dot(c.cwiseProduct(o)) + 2 * o.z();
  const double discriminant = g * g - a * f;
  if (discriminant < 0) return std::nullopt;
  // The farther root of a t^2 + 2 g t + f = 0; a is negative for a retina, whose centre lies before its pole.
  const double root = std::sqrt(discriminant), t = std::max((-g - root) / a, (-g + root) / a);
  if (t < 0) return std::nullopt;
  const Eigen::Vector3d at = o + t * v;
  const Eigen::Vector3d inward = (c.cwiseProduct(at) + Eigen::Vector3d::UnitZ()).normalized();
  return RetinaPoint{turn.inverse() * at, turn.inverse() * inward};
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

std::optional<RetinaPoint> meet_retina(const EyeModel& eye, const Ray& inside) {
  const Surface& retina = eye.retina();
  const Ray ray = in_frame_of(retina, inside);
  std::optional<RetinaPoint> point;
  if (const std::optional<Whole> whole = whole_of(retina.shape->formula())) {
    point = left_at(*whole, ray);
  } else if (const std::optional<ShapeHit> hit = retina.shape->intersect(ray)) {
    point = RetinaPoint{hit->position, hit->normal};
  }
  if (!point) return std::nullopt;
  const bool in_front_of_equator = point->normal.z() < 0;
  if (retina.semi_diameter_mm > 0 &&
      (in_front_of_equator || point->position_mm.head<2>().norm() > retina.semi_diameter_mm))
    return std::nullopt;
  const Eigen::Isometry3d eye_from_surface = retina.eye_from_surface();
  return RetinaPoint{eye_from_surface * point->position_mm, eye_from_surface.linear() * point->normal};
}

Eigen::Vector3d retina_centre(const EyeModel& eye) { return {0, 0, -centre_depth_mm(eye.retina())}; }

}  // namespace emmetrope
