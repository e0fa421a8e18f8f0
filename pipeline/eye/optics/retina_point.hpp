#pragma once
#include <optional>

#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope {

/// A point of the retina and the unit normal there, towards the light, in the eye's frame.
struct RetinaPoint {
  Eigen::Vector3d position_mm, normal;
};

/// The retina behind the equator at eye x and y; nothing where it does not reach there or its clear aperture
/// ends before.
std::optional<RetinaPoint> meet_retina(const EyeModel& eye, const Eigen::Vector2d& from_pole_mm);

/// Where a ray inside the eye meets the retina, in front of its equator too: a sphere, conic or ellipsoid is whole,
/// other forms and meshes reach as far as they do. Nothing in front of the equator where it has a clear aperture.
std::optional<RetinaPoint> meet_retina(const EyeModel& eye, const Ray& inside);

/// Within the retina's curve, on the eye's axis, eye frame: polar angles of the retina are counted about it.
Eigen::Vector3d retina_centre(const EyeModel& eye);

}  // namespace emmetrope
