#pragma once
#include <optional>

#include "pipeline/eye/optics/retina_point.hpp"

namespace emmetrope::raytrace {

/// Distances along the retina from its pole, mm, in the plane that holds the eye's axis and the point, beyond the
/// equator too: geodesics where the retina is a surface of revolution about that axis.

/// \param from_pole_mm  the distance, towards eye x and y
std::optional<RetinaPoint> retina_at_arc(const EyeModel& eye, const Eigen::Vector2d& from_pole_mm);

/// \param point  of the retina
std::optional<double> retina_arc_mm(const EyeModel& eye, const Eigen::Vector3d& point);

}  // namespace emmetrope::raytrace
