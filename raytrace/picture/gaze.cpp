#include "raytrace/picture/gaze.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

/// Listing's turn that brings straight ahead into the direction of gaze.
Eigen::Quaterniond listing(const Gaze& gaze) {
  return Eigen::Quaterniond::FromTwoVectors(
      Eigen::Vector3d::UnitZ(),
      Eigen::Vector3d(std::tan(gaze.horizontal_deg * degree), std::tan(gaze.vertical_deg * degree), 1));
}

}  // namespace

void EyePose::check() const {
  if (std::abs(gaze.horizontal_deg) > 60 || std::abs(gaze.vertical_deg) > 60)
    throw usage_error("--gaze: an eye does not turn by more than 60 degrees");
}

Eigen::Isometry3d EyePose::turned_from_straight() const {
  if (gaze.horizontal_deg == 0 && gaze.vertical_deg == 0) return Eigen::Isometry3d::Identity();
  const Eigen::Vector3d centre(0, 0, -rotation_centre_mm);
  return Eigen::Translation3d(centre) * listing(gaze).inverse() * Eigen::Translation3d(-centre);
}

Eigen::Isometry3d EyePose::eye_from_scene() const {
  return turned_from_straight() * Eigen::Translation3d(-apex_mm);
}

Gaze gaze_at(const EyePose& eye, const Eigen::Vector3d& point_mm, const Eigen::Vector2d& deviation_prism) {
  const auto gaze_along = [](const Eigen::Vector3d& direction) {
    if (!(direction.z() > 0))
      throw usage_error("an eye cannot look at a point beside or behind its centre of rotation");
    return Gaze{std::atan(direction.x() / direction.z()) / degree,
                std::atan(direction.y() / direction.z()) / degree};
  };
  const Eigen::Vector3d centre = eye.apex_mm - Eigen::Vector3d(0, 0, eye.rotation_centre_mm);
  const Gaze aligned = gaze_along(point_mm - centre);
  constexpr double nearest_mm = 20;  // metres, or within the eye
  if (const double ahead_mm = point_mm.z() - eye.apex_mm.z(); ahead_mm < nearest_mm)
    throw usage_error(fmt::format("an eye cannot look at a point {:.3g} mm ahead of it, nearer than {:g}",
                                  ahead_mm, nearest_mm),
                      "points are in mm");
  if (deviation_prism.isZero(0)) return aligned;
  // a prism dioptre is a hundredth of the tangent
  return gaze_along(listing(aligned) *
                    Eigen::Vector3d(deviation_prism.x() / 100, deviation_prism.y() / 100, 1));
}

}  // namespace emmetrope::raytrace
