#include "pipeline/eye/optics/chief_ray.hpp"

#include <Eigen/Dense>

#include "pipeline/eye/optics/paraxial.hpp"

namespace emmetrope {

ChiefRays::ChiefRays(const EyeModel& eye, double wavelength_nm)
    : crossing_(eye, wavelength_nm),
      tracer_(without_stop(eye), wavelength_nm),
      entrance_pupil_z_mm_(-entrance_pupil(eye, wavelength_nm).position_mm),
      exit_pupil_z_mm_(-exit_pupil(eye, wavelength_nm).position_mm) {}

std::optional<Ray> ChiefRays::line_of_sight(const Eigen::Vector3d& retina) const {
  const std::optional<StopCentreAim> centre = aim_at_stop_centre(crossing_, retina, exit_pupil_z_mm_);
  if (!centre) return std::nullopt;
  const Eigen::Vector3d aim(centre->aim_mm.x(), centre->aim_mm.y(), exit_pupil_z_mm_);
  const ExactTracer::End end = tracer_.trace_end({retina, (aim - retina).normalized()});
  if (end.state != RayState::reached || end.direction.z() <= 0) return std::nullopt;
  return Ray{end.position_mm, end.direction};
}

std::optional<Eigen::Vector3d> ChiefRays::image_of(const Eigen::Vector3d& direction) const {
  constexpr double away_mm = 100;  // beyond anything worn
  const Eigen::Vector3d towards = direction.normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(towards).normalized(), y = towards.cross(x);
  // From the entrance pupil as seen along the axis, by Newton's method across the direction.
  Eigen::Vector2d shift(0, 0);
  const auto ray = [&](const Eigen::Vector2d& at) {
    return Ray{Eigen::Vector3d(0, 0, entrance_pupil_z_mm_) + away_mm * towards + at.x() * x + at.y() * y,
               -towards};
  };
  constexpr double step_mm = 1e-3;
  for (int round = 0; round < 30; ++round) {
    const auto middle = crossing_.inward(ray(shift)),
               right = crossing_.inward(ray(shift + Eigen::Vector2d(step_mm, 0))),
               up = crossing_.inward(ray(shift + Eigen::Vector2d(0, step_mm)));
    if (!middle || !right || !up) return std::nullopt;
    if (middle->norm() < 1e-9) break;
    Eigen::Matrix2d stop_from_shift;
    stop_from_shift << (*right - *middle) / step_mm, (*up - *middle) / step_mm;
    shift -= stop_from_shift.inverse() * *middle;
  }
  const ExactTracer::End end = tracer_.trace_end(ray(shift));
  if (end.state != RayState::reached) return std::nullopt;
  return end.position_mm;
}

}  // namespace emmetrope
