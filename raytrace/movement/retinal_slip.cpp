#include "raytrace/movement/retinal_slip.hpp"

#include <array>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::raytrace {
namespace {

Eigen::Isometry3d turn_at(EyePose pose, const Movement& movement, Laterality side, double time_s) {
  pose.gaze = movement.at(time_s).gaze_of(side);
  return pose.turned_from_straight();
}

/// What of a small change lies across an axis, along x and y as the smallest turn from +z carries them there.
Eigen::Vector2d across(const Eigen::Vector3d& axis, const Eigen::Vector3d& change) {
  return (Eigen::Quaterniond::FromTwoVectors(axis, Eigen::Vector3d::UnitZ()) * change).head<2>();
}

}  // namespace

std::optional<RetinalSlip> retinal_slip(const EyeModel& eye, const EyePose& pose, const Movement& movement,
                                        Laterality side, double time_s, const Eigen::Vector2d& retina_mm,
                                        double wavelength_nm) {
  constexpr double half_s = 0.5e-3;
  const Eigen::Isometry3d turned = turn_at(pose, movement, side, time_s);
  const RetinaPoint retina = retina_point(eye, retina_mm.x(), retina_mm.y());
  const std::optional<Ray> sight =
      ChiefRays(fixed_to_head(eye, turned), wavelength_nm).line_of_sight(retina.position_mm);
  if (!sight) return std::nullopt;
  const Eigen::Vector3d far_away = turned.linear().transpose() * sight->direction;
  std::array<Eigen::Vector3d, 2> direction, image;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Isometry3d then = turn_at(pose, movement, side, time_s + (2 * k - 1) * half_s);
    direction[k] = then.linear() * far_away;
    const auto seen = ChiefRays(fixed_to_head(eye, then), wavelength_nm).image_of(direction[k]);
    if (!seen) return std::nullopt;
    image[k] = seen->position_mm;
  }
  return RetinalSlip{across(retina.normal, image[1] - image[0]) / (2 * half_s),
                     across(sight->direction, direction[1] - direction[0]) / degree / (2 * half_s)};
}

}  // namespace emmetrope::raytrace
