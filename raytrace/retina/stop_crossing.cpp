#include "raytrace/retina/stop_crossing.hpp"

#include <algorithm>

#include "pipeline/base/error.hpp"

namespace emmetrope::raytrace {
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
  const auto behind = std::next(stop);
  behind_stop_ = std::next(behind) == eye.surfaces.end() ? "" : behind->name;
}

std::optional<Eigen::Vector2d> StopCrossing::operator()(const Eigen::Vector3d& retina,
                                                        const Eigen::Vector3d& target) const {
  Ray ray{retina, (target - retina).normalized()};
  if (!behind_stop_.empty()) {
    const RayPath path = open_.trace(ray);
    const auto hit = std::find_if(path.hits.begin(), path.hits.end(),
                                  [&](const RayHit& h) { return h.surface == behind_stop_; });
    if (hit == path.hits.end() || (path.state != RayState::reached && path.at == behind_stop_))
      return std::nullopt;
    ray = {hit->position_mm, hit->direction};
  }
  const Eigen::Vector3d p = stop_from_eye_ * ray.origin, d = stop_from_eye_.linear() * ray.direction;
  if (d.z() <= 0) return std::nullopt;
  return Eigen::Vector2d(p.head<2>() - p.z() / d.z() * d.head<2>());
}

}  // namespace emmetrope::raytrace
