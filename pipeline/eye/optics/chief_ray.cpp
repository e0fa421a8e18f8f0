#include "pipeline/eye/optics/chief_ray.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "pipeline/eye/optics/paraxial.hpp"

namespace emmetrope {

namespace {

bool is_worn(const Surface& surface) { return surface.bearer == Bearer::head; }

}  // namespace

ChiefRays::ChiefRays(const EyeModel& eye, double wavelength_nm)
    : eye_(eye),
      worn_surfaces_(std::count_if(eye.surfaces.begin(), eye.surfaces.end(), is_worn)),
      crossing_(eye, wavelength_nm),
      tracer_(without_stop(eye), wavelength_nm),
      entrance_pupil_z_mm_(-entrance_pupil(eye, wavelength_nm).position_mm),
      aim_plane_z_mm_(emmetrope::aim_plane_z_mm(eye, wavelength_nm)) {}

std::optional<Ray> ChiefRays::line_of_sight(const Eigen::Vector3d& retina) const {
  const std::optional<StopCentreAim> centre = aim_at_stop_centre(crossing_, retina, aim_plane_z_mm_);
  if (!centre) return std::nullopt;
  const Eigen::Vector3d aim(centre->aim_mm.x(), centre->aim_mm.y(), aim_plane_z_mm_);
  const RayPath path = tracer_.trace({retina, (aim - retina).normalized()});
  if (path.state != RayState::reached || !passes_what_is_worn(path)) return std::nullopt;
  return Ray{path.hits.back().position_mm, path.hits.back().direction};
}

bool ChiefRays::passes_what_is_worn(const RayPath& path) const {
  return worn_surfaces_ == std::count_if(path.hits.begin(), path.hits.end(), [&](const RayHit& hit) {
           return is_worn(eye_.surface(hit.surface));
         });
}

/// A ray from a direction, known by how far it passes from the entrance pupil as seen along the axis.
struct ChiefRays::FromDirection {
  Eigen::Vector3d pupil, towards, x, y;
  FromDirection(double entrance_pupil_z_mm, double meridian_rad, double eccentricity_rad)
      : pupil(0, 0, entrance_pupil_z_mm),
        towards(std::sin(eccentricity_rad) * std::cos(meridian_rad),
                std::sin(eccentricity_rad) * std::sin(meridian_rad), std::cos(eccentricity_rad)),
        // Across the meridian, along it: the same at every eccentricity, so that a shift keeps its meaning.
        x(-std::sin(meridian_rad), std::cos(meridian_rad), 0),
        y(towards.cross(x)) {}
  Ray operator()(const Eigen::Vector2d& shift_mm) const {
    // Beyond anything worn; from beside the eye no further than what lies before its surfaces.
    const double away_mm = towards.z() > 0.2 ? 100 : 15;
    return {pupil + away_mm * towards + shift_mm.x() * x + shift_mm.y() * y, -towards};
  }
};

std::optional<Eigen::Vector2d> ChiefRays::shift_to_centre(const FromDirection& ray,
                                                          Eigen::Vector2d shift_mm) const {
  constexpr double step_mm = 1e-3;
  std::optional<Eigen::Vector2d> middle = crossing_.inward(ray(shift_mm));
  for (int round = 0; round < 40 && middle; ++round) {
    if (middle->norm() < 1e-9) return shift_mm;
    const auto right = crossing_.inward(ray(shift_mm + Eigen::Vector2d(step_mm, 0))),
               up = crossing_.inward(ray(shift_mm + Eigen::Vector2d(0, step_mm)));
    if (!right || !up) return std::nullopt;
    Eigen::Matrix2d stop_from_shift;
    stop_from_shift << (*right - *middle) / step_mm, (*up - *middle) / step_mm;
    // A step that loses the ray, or leads away, is halved.
    Eigen::Vector2d step = -(stop_from_shift.inverse() * *middle);
    std::optional<Eigen::Vector2d> next;
    for (int halving = 0; halving < 12; ++halving, step /= 2) {
      next = crossing_.inward(ray(shift_mm + step));
      if (next && next->norm() < middle->norm()) break;
      next.reset();
    }
    shift_mm += step;
    middle = next;
  }
  return std::nullopt;
}

std::optional<RetinaPoint> ChiefRays::met_on_retina(const Ray& ray_in_eye) const {
  RayPath path = tracer_.trace_inward(ray_in_eye);
  if (path.at != eye_.retina().name || !passes_what_is_worn(path)) return std::nullopt;
  // From the last surface before it: there is more of a retina than the sheet behind its equator.
  if (path.state == RayState::reached) path.hits.pop_back();
  if (path.hits.empty()) return meet_retina(eye_, ray_in_eye);
  return meet_retina(eye_, Ray{path.hits.back().position_mm, path.hits.back().direction});
}

std::optional<RetinaPoint> ChiefRays::image_of(const Eigen::Vector3d& direction) const {
  const double eccentricity_rad = std::atan2(direction.head<2>().norm(), direction.z());
  const double meridian_rad = std::atan2(direction.y(), direction.x());
  const auto at_share = [&](double share) {
    return FromDirection(entrance_pupil_z_mm_, meridian_rad, share * eccentricity_rad);
  };
  // At once; where that loses the ray, in ever smaller steps from the axis outward.
  for (const int steps : {1, 4, 16, 64}) {
    std::optional<Eigen::Vector2d> shift_mm = Eigen::Vector2d(0, 0);
    for (int k = 1; k <= steps && shift_mm; ++k)
      shift_mm = shift_to_centre(at_share(static_cast<double>(k) / steps), *shift_mm);
    if (!shift_mm) continue;
    return met_on_retina(at_share(1)(*shift_mm));
  }
  return std::nullopt;
}

}  // namespace emmetrope
