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

}  // namespace emmetrope
