#include "correction/search/lens_family.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::correction {
namespace {

/// Largest power that is sought in a meridian, D.
constexpr double strongest_D = 40;

PowerVector cylinder_power(int sign, const Eigen::VectorXd& lens) {
  return {sign * std::hypot(lens[0], lens[1]), lens[0], lens[1]};
}

/// Before the cornea by as much as is asked for, clear of it in any case.
double standing_mm(const EyeModel& eye, double distance_mm) {
  constexpr double farthest_reach_mm = 1;  // of a cornea in front of its vertex
  return distance_mm > farthest_reach_mm ? distance_mm : std::max(distance_mm, clear_of_cornea_mm(eye));
}

}  // namespace

double clear_of_cornea_mm(const EyeModel& eye) {
  constexpr double clearance_mm = 1e-3, radius_mm = 2;
  constexpr int rings = 20, spokes = 24;
  const Surface& cornea = eye.surfaces.front();
  const Eigen::Isometry3d eye_from_cornea = cornea.eye_from_surface();
  double foremost_mm = 0;
  for (int i = 1; i <= rings; ++i)
    for (int k = 0; k < spokes; ++k) {
      const double r = radius_mm * i / rings, angle = 2 * pi * k / spokes;
      const double x = r * std::cos(angle), y = r * std::sin(angle);
      if (const auto depth = cornea.shape->depth_mm(x, y))
        foremost_mm = std::max(foremost_mm, (eye_from_cornea * Eigen::Vector3d(x, y, -*depth)).z());
    }
  return foremost_mm + clearance_mm;
}

std::vector<raytrace::EyeTangent> LensFamily::tangents(const EyeModel& eye,
                                                       const Eigen::VectorXd& lens) const {
  constexpr double step_D = 0.05;  // small against what curves an image's dependence, large against rounding
  std::vector<raytrace::EyeTangent> result;
  for (Eigen::Index k = 0; k < lens.size(); ++k) {
    // One-sided at a bound: a cylinder's power is a distance from 0, behind which its axis would turn.
    Eigen::VectorXd above = lens, below = lens;
    above[k] = std::min(lens[k] + step_D, bounds.upper[k]);
    below[k] = std::max(lens[k] - step_D, bounds.lower[k]);
    result.push_back({before(eye, above), before(eye, below), above[k] - below[k]});
  }
  return result;
}

LensFamily thin_lens(double vertex_distance_mm) {
  const auto power = [](const Eigen::VectorXd& lens) { return PowerVector{lens[0], lens[1], lens[2]}; };
  return {"thin lens",
          {Eigen::Vector3d(-strongest_D, -strongest_D / 2, -strongest_D / 2),
           Eigen::Vector3d(strongest_D, strongest_D / 2, strongest_D / 2)},
          [=](const EyeModel& eye, const Eigen::VectorXd& lens) {
            return raytrace::with_thin_lens(eye, power(lens), standing_mm(eye, vertex_distance_mm));
          },
          power};
}

LensFamily plano_cylinder(int sign, double distance_mm, double index) {
  const double largest_D = strongest_D / 2;
  return {sign < 0 ? "plano-cylinder, minus" : "plano-cylinder, plus",
          {Eigen::Vector2d(-largest_D, -largest_D), Eigen::Vector2d(largest_D, largest_D)},
          [=](const EyeModel& eye, const Eigen::VectorXd& lens) {
            const PlanoCylinder cylinder = plano_cylinder_of(sign, lens, index);
            return raytrace::with_plano_cylinder(eye, cylinder.radius_mm, cylinder.axis_deg,
                                                 standing_mm(eye, distance_mm), index);
          },
          [=](const Eigen::VectorXd& lens) { return cylinder_power(sign, lens); }};
}

LensFamily along(const LensFamily& family, const Eigen::VectorXd& direction) {
  const Eigen::VectorXd highest = family.bounds.upper.cwiseQuotient(direction.cwiseAbs());
  return {family.name,
          {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, highest.minCoeff())},
          [=](const EyeModel& eye, const Eigen::VectorXd& t) { return family.before(eye, t[0] * direction); },
          [=](const Eigen::VectorXd& t) { return family.power(t[0] * direction); }};
}

LensFamily polar(const LensFamily& family, const Eigen::Vector2d& start) {
  const double radius = start.norm(), angle = std::atan2(start[1], start[0]);
  const auto cartesian = [=](const Eigen::VectorXd& polar) -> Eigen::VectorXd {
    const double at = angle + polar[1] / radius;
    return polar[0] * Eigen::Vector2d(std::cos(at), std::sin(at));
  };
  const double half_turn = pi * radius;
  return {
      family.name,
      {Eigen::Vector2d(0, -half_turn), Eigen::Vector2d(family.bounds.upper.minCoeff(), half_turn)},
      [=](const EyeModel& eye, const Eigen::VectorXd& lens) { return family.before(eye, cartesian(lens)); },
      [=](const Eigen::VectorXd& lens) { return family.power(cartesian(lens)); }};
}

PlanoCylinder plano_cylinder_of(int sign, const Eigen::VectorXd& lens, double index) {
  // In minus cylinder a plus cylinder is S = C_plus, C = -C_plus, across: its meridian without power is the
  // one where the power vector gives 0.
  const double power_D = sign * 2 * std::hypot(lens[0], lens[1]);
  const double axis_of_minus_deg = 0.5 * std::atan2(lens[1], lens[0]) / degree;
  const double flattest_D = 1e-6;  // a radius of 500 km: no lens at all
  return {1e3 * (1 - index) / (std::abs(power_D) < flattest_D ? sign * flattest_D : power_D),
          normalise_axis_deg(sign < 0 ? axis_of_minus_deg : axis_of_minus_deg + 90), power_D};
}

Eigen::Vector2d plano_cylinder_parameters(double radius_mm, double axis_deg, double index) {
  const PowerVector power = to_power_vector({0, 1e3 * (1 - index) / radius_mm, axis_deg});
  return {power.J0_D, power.J45_D};
}

}  // namespace emmetrope::correction
