#include "pipeline/eye/optics/stop_crossing.hpp"

#include <Eigen/LU>
#include <algorithm>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

EyeModel wide_open(EyeModel eye) {
  eye.set_stop_diameter(1e3);
  return eye;
}

}  // namespace

StopCrossing::StopCrossing(const EyeModel& eye, double wavelength_nm) : open_(wide_open(eye), wavelength_nm) {
  const auto stop = std::find_if(eye.surfaces.begin(), eye.surfaces.end(),
                                 [](const Surface& surface) { return surface.is_stop(); });
  if (stop == eye.surfaces.end())
    throw input_error("eye \"" + eye.name + "\" has no stop", "add a surface of type stop with diameter_mm");
  radius_mm_ = stop->stop_diameter_mm / 2;
  stop_from_eye_ = stop->eye_from_surface().inverse();
  if (stop != eye.surfaces.begin()) before_stop_ = std::prev(stop)->name;
  const auto behind = std::next(stop);
  behind_stop_ = std::next(behind) == eye.surfaces.end() ? "" : behind->name;
}

std::optional<Ray> StopCrossing::beyond(const std::string& surface, const Ray& ray) const {
  if (surface.empty()) return ray;
  const RayPath path = open_.trace(ray);
  const auto hit =
      std::find_if(path.hits.begin(), path.hits.end(), [&](const RayHit& h) { return h.surface == surface; });
  if (hit == path.hits.end() || (path.state != RayState::reached && path.at == surface)) return std::nullopt;
  return Ray{hit->position_mm, hit->direction};
}

std::optional<Eigen::Vector2d> StopCrossing::in_stop_plane(const Ray& straight) const {
  const Eigen::Vector3d p = stop_from_eye_ * straight.origin,
                        d = stop_from_eye_.linear() * straight.direction;
  if (d.z() == 0) return std::nullopt;
  return Eigen::Vector2d(p.head<2>() - p.z() / d.z() * d.head<2>());
}

std::optional<Eigen::Vector2d> StopCrossing::operator()(const Eigen::Vector3d& retina,
                                                        const Eigen::Vector3d& target) const {
  const std::optional<Ray> ray = beyond(behind_stop_, {retina, (target - retina).normalized()});
  if (!ray || (stop_from_eye_.linear() * ray->direction).z() <= 0) return std::nullopt;
  return in_stop_plane(*ray);
}

std::optional<Eigen::Vector2d> StopCrossing::inward(const Ray& ray_in_eye) const {
  const std::optional<Ray> ray = beyond(before_stop_, ray_in_eye);
  if (!ray || (stop_from_eye_.linear() * ray->direction).z() >= 0) return std::nullopt;
  return in_stop_plane(*ray);
}

std::optional<StopCentreAim> aim_at_stop_centre(const StopCrossing& crossing, const Eigen::Vector3d& retina,
                                                double plane_z_mm) {
  const auto at_stop = [&](const Eigen::Vector2d& aim) {
    return crossing(retina, {aim.x(), aim.y(), plane_z_mm});
  };
  // Newton's method from straight ahead, its differences ever finer: the map is nearly affine.
  StopCentreAim centre;
  double step_mm = 0.2;
  for (int round = 0; round < 20; ++round) {
    const auto middle = at_stop(centre.aim_mm), right = at_stop(centre.aim_mm + Eigen::Vector2d(step_mm, 0)),
               up = at_stop(centre.aim_mm + Eigen::Vector2d(0, step_mm));
    if (!middle || !right || !up) return std::nullopt;
    Eigen::Matrix2d stop_from_aim;
    stop_from_aim << (*right - *middle) / step_mm, (*up - *middle) / step_mm;
    centre.aim_from_stop = stop_from_aim.inverse();
    if (middle->norm() < 1e-10) break;
    centre.aim_mm -= centre.aim_from_stop * *middle;
    step_mm = std::clamp(middle->norm(), 1e-3, step_mm);
  }
  return centre;
}

}  // namespace emmetrope
