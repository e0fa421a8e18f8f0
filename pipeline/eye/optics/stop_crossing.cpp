#include "pipeline/eye/optics/stop_crossing.hpp"

#include <Eigen/LU>
#include <algorithm>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/optics/paraxial.hpp"

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

std::optional<Ray> StopCrossing::beyond(const std::string& surface, const Ray& ray, bool inward) const {
  if (surface.empty()) return ray;
  const RayPath path = inward ? open_.trace_inward(ray) : open_.trace(ray);
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
  const std::optional<Ray> ray = beyond(behind_stop_, {retina, (target - retina).normalized()}, false);
  if (!ray || (stop_from_eye_.linear() * ray->direction).z() <= 0) return std::nullopt;
  return in_stop_plane(*ray);
}

std::optional<Eigen::Vector2d> StopCrossing::inward(const Ray& ray_in_eye) const {
  const std::optional<Ray> ray = beyond(before_stop_, ray_in_eye, true);
  if (!ray || (stop_from_eye_.linear() * ray->direction).z() >= 0) return std::nullopt;
  return in_stop_plane(*ray);
}

double aim_plane_z_mm(const EyeModel& eye, double wavelength_nm) {
  const double pupil_mm = exit_pupil(eye, wavelength_nm).position_mm,
               last_mm = eye.surfaces.at(eye.surfaces.size() - 2).position_mm;
  const bool inside = pupil_mm > 0 && pupil_mm <= last_mm;
  return inside ? -pupil_mm : -last_mm;
}

namespace {

/// Newton's method, its differences ever finer: the map is nearly affine. A step that loses the ray, or leads away,
/// is halved.
template <typename AtStop>
std::optional<StopCentreAim> aim_from(const Eigen::Vector2d& start_mm, const AtStop& at_stop) {
  StopCentreAim centre;
  centre.aim_mm = start_mm;
  std::optional<Eigen::Vector2d> middle = at_stop(centre.aim_mm);
  double step_mm = 0.2;
  for (int round = 0; round < 30 && middle; ++round) {
    const auto right = at_stop(centre.aim_mm + Eigen::Vector2d(step_mm, 0)),
               up = at_stop(centre.aim_mm + Eigen::Vector2d(0, step_mm));
    if (!right || !up) return std::nullopt;
    Eigen::Matrix2d stop_from_aim;
    stop_from_aim << (*right - *middle) / step_mm, (*up - *middle) / step_mm;
    centre.aim_from_stop = stop_from_aim.inverse();
    if (middle->norm() < 1e-10) return centre;
    Eigen::Vector2d step = -(centre.aim_from_stop * *middle);
    std::optional<Eigen::Vector2d> next;
    for (int halving = 0; halving < 12; ++halving, step /= 2) {
      next = at_stop(centre.aim_mm + step);
      if (next && next->norm() < middle->norm()) break;
      next.reset();
    }
    // Facets may keep it from the last digits.
    if (!next) return middle->norm() < 1e-6 ? std::optional(centre) : std::nullopt;
    centre.aim_mm += step;
    middle = next;
    step_mm = std::clamp(middle->norm(), 1e-3, step_mm);
  }
  return std::nullopt;
}

}  // namespace

std::optional<StopCentreAim> aim_at_stop_centre(const StopCrossing& crossing, const Eigen::Vector3d& retina,
                                                double plane_z_mm) {
  const auto at_stop = [&](const Eigen::Vector2d& aim) {
    return crossing(retina, {aim.x(), aim.y(), plane_z_mm});
  };
  // From straight ahead; at wide angles, where that loses the ray, from beside: the pupil leans to where it is seen
  // from.
  const Eigen::Vector2d meridian = retina.head<2>().stableNormalized();
  for (const double beside_mm : {0.0, 0.5, 1.0, 1.5, -0.5, -1.0})
    if (auto centre = aim_from(beside_mm * meridian, at_stop)) return centre;
  return std::nullopt;
}

}  // namespace emmetrope
