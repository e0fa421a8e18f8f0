#include "raytrace/wavefront/retinal_pencil.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "raytrace/retina/pupil_aim.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int rim_angles = 49;
/// How finely the edge is found beyond which rays are lost, mm.
constexpr double edge_mm = 1e-6;

}  // namespace

RetinalPencil::RetinalPencil(const EyeModel& eye, double wavelength_nm, const Eigen::Vector2d& fovea_mm)
    : tracer_(without_stop(eye), wavelength_nm),
      source_(retina_point(eye, fovea_mm.x(), fovea_mm.y()).position_mm),
      aim_plane_z_mm_(emmetrope::aim_plane_z_mm(eye, wavelength_nm)) {
  if (eye.stop() != nullptr) {
    stop_.emplace(eye, wavelength_nm);
    const std::optional<StopCentreAim> centre = aim_at_stop_centre(*stop_, source_, aim_plane_z_mm_);
    if (!centre) throw no_result_error("the ray through the centre of the stop does not leave the eye");
    chief_aim_ = centre->aim_mm;
  }
  find_line_of_sight(-entrance_pupil(eye, wavelength_nm).position_mm);
  // Plane coordinates against aim coordinates about the line of sight.
  constexpr double h = 0.05;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = h * Eigen::Vector2d::Unit(k);
    const std::optional<PlaneCrossing> ahead = crossing(chief_aim_ + step),
                                       behind = crossing(chief_aim_ - step);
    if (!ahead || !behind) throw no_result_error("rays near the line of sight do not leave the eye");
    plane_from_aim_.col(k) = (ahead->position_mm - behind->position_mm) / (2 * h);
  }
}

std::optional<PlaneCrossing> RetinalPencil::through(const Eigen::Vector2d& plane_mm) const {
  // Broyden's method from the linear map about the line of sight; a step that loses the ray, or leads away, is
  // halved, so that what lies near an edge is approached from inside.
  Eigen::Matrix2d plane_from_aim = plane_from_aim_;
  Eigen::Vector2d step = plane_from_aim.inverse() * plane_mm;
  std::optional<PlaneCrossing> at = crossing(chief_aim_);
  constexpr double least_step = 1e-6;
  for (int iteration = 0; iteration < 60 && at; ++iteration) {
    const Eigen::Vector2d error = plane_mm - at->position_mm;
    if (error.norm() < 1e-10) return at;
    std::optional<PlaneCrossing> next;
    double share = 1;
    for (; share > least_step; share /= 2) {
      next = crossing(at->aim_mm + share * step);
      if (next && (plane_mm - next->position_mm).norm() < error.norm()) break;
    }
    if (share <= least_step) break;
    const Eigen::Vector2d aim_change = next->aim_mm - at->aim_mm,
                          unforeseen = next->position_mm - at->position_mm - plane_from_aim * aim_change;
    plane_from_aim += unforeseen * aim_change.transpose() / aim_change.squaredNorm();
    at = next;
    step = plane_from_aim.inverse() * (plane_mm - at->position_mm);
    if (!step.allFinite()) break;
  }
  if (at && (plane_mm - at->position_mm).norm() > 1e-8) return std::nullopt;
  return at;
}

PupilRim RetinalPencil::rim() const {
  PupilRim rim;
  double guess_mm = stop_->stop_radius_mm();
  for (int k = 0; k < rim_angles; ++k) {
    const double angle = 2 * pi * k / rim_angles;
    rim.radius_mm.push_back(guess_mm = rim_radius_mm({std::cos(angle), std::sin(angle)}, guess_mm));
  }
  return rim;
}

double RetinalPencil::rim_radius_mm(const Eigen::Vector2d& direction, double first_guess_mm) const {
  const double wanted_mm = stop_->stop_radius_mm();
  // The distance from the stop's centre, nothing where the ray is lost.
  const auto in_stop = [&](double radius_mm) -> std::optional<double> {
    const std::optional<PlaneCrossing> at = through(radius_mm * direction);
    const std::optional<Eigen::Vector2d> place = at ? (*stop_)(source_, target(at->aim_mm)) : std::nullopt;
    if (!place) return std::nullopt;
    return place->norm();
  };
  // The place in the stop is nearly proportional to that in the plane.
  double radius_mm = first_guess_mm, passed_mm = 0, lost_mm = HUGE_VAL;
  for (int iteration = 0; iteration < 60 && lost_mm - passed_mm > edge_mm; ++iteration) {
    const std::optional<double> reached_mm = in_stop(radius_mm);
    if (!reached_mm) {
      lost_mm = radius_mm;
      radius_mm = 0.5 * (passed_mm + lost_mm);
      continue;
    }
    if (std::abs(*reached_mm - wanted_mm) < 1e-9) return radius_mm;
    const double next_mm = radius_mm * wanted_mm / *reached_mm;
    if (*reached_mm < wanted_mm) passed_mm = std::max(passed_mm, radius_mm);
    radius_mm = next_mm < lost_mm ? next_mm : 0.5 * (passed_mm + lost_mm);
  }
  return lost_mm < HUGE_VAL ? passed_mm : radius_mm;
}

Eigen::Vector2d RetinalPencil::tangential() const {
  const Eigen::Vector2d axis(x_axis_.z(), y_axis_.z());  // the eye's axis across the line of sight
  return axis.norm() < std::sin(degree) ? Eigen::Vector2d::UnitY() : Eigen::Vector2d(axis.normalized());
}

void RetinalPencil::find_line_of_sight(double entrance_pupil_z_mm) {
  const ExactTracer::End chief = tracer_.trace_end(aimed(chief_aim_));
  if (chief.state != RayState::reached || chief.direction.z() <= 0)
    throw no_result_error("the line of sight does not leave the eye");
  line_of_sight_ = chief.direction;
  centre_ = chief.position_mm +
            (entrance_pupil_z_mm - chief.position_mm.z()) / chief.direction.z() * chief.direction;
  x_axis_ = Eigen::Vector3d::UnitY().cross(line_of_sight_).normalized();
  y_axis_ = line_of_sight_.cross(x_axis_);
}

std::optional<PlaneCrossing> RetinalPencil::crossing(const Eigen::Vector2d& aim) const {
  const ExactTracer::End end = tracer_.trace_end(aimed(aim));
  if (end.state != RayState::reached || end.direction.z() <= 0) return std::nullopt;
  const double distance = (centre_ - end.position_mm).dot(line_of_sight_) / end.direction.dot(line_of_sight_);
  const Eigen::Vector3d offset = end.position_mm + distance * end.direction - centre_;
  return PlaneCrossing{{offset.dot(x_axis_), offset.dot(y_axis_)},
                       {end.direction.dot(x_axis_), end.direction.dot(y_axis_)},
                       end.opl_mm + distance,
                       aim};
}

}  // namespace emmetrope::raytrace
