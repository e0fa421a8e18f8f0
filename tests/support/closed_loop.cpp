#include "tests/support/closed_loop.hpp"

#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "correction/prescription/prescription.hpp"
#include "correction/sharpness/refraction_chart.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"

namespace emmetrope::correction {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

Matrix2d power_matrix(const Lens& lens) {
  Matrix2d power;
  power << lens[0] + lens[1], lens[2], lens[2], lens[0] - lens[1];
  return power;
}

/// Where a ray lands that crosses the lens's plane with that slope behind it; nothing where the iris stops
/// it.
std::optional<Vector2d> land(const ExactTracer& tracer, double vertex_distance_mm, const Vector2d& place_mm,
                             const Vector2d& slope) {
  const Vector3d direction(slope.x(), slope.y(), -1);
  const auto end =
      tracer.trace_end({{place_mm.x(), place_mm.y(), vertex_distance_mm}, direction.normalized()});
  if (end.state != RayState::reached) return std::nullopt;
  return Vector2d(end.position_mm.head<2>());
}

/// Gauss and Legendre's rule on [0, 1] with five nodes, for the square of the distance from the centre: exact
/// for an area's moments to the 18th power of that distance.
struct Node {
  double at, weight;
};
constexpr std::array<Node, 5> area_nodes{{{0.046910077030668, 0.118463442528095},
                                          {0.230765344947158, 0.239314335249683},
                                          {0.5, 0.284444444444444},
                                          {0.769234655052842, 0.239314335249683},
                                          {0.953089922969332, 0.118463442528095}}};

}  // namespace

Lens paraxial_by_pencils(const EyeModel& eye, double wavelength_nm, double vertex_distance_mm) {
  const ExactTracer tracer(eye, wavelength_nm);
  constexpr double step_mm = 0.01, step_slope = 1e-5;
  Matrix2d by_place, by_slope;
  for (int k = 0; k < 2; ++k) {
    const Vector2d unit = Vector2d::Unit(k), none = Vector2d::Zero();
    const auto at = [&](const Vector2d& place_mm, const Vector2d& slope) {
      return land(tracer, vertex_distance_mm, place_mm, slope).value();
    };
    by_place.col(k) = (at(step_mm * unit, none) - at(-step_mm * unit, none)) / (2 * step_mm);
    by_slope.col(k) = (at(none, step_slope * unit) - at(none, -step_slope * unit)) / (2 * step_slope);
  }
  const Matrix2d power = 1e3 * by_slope.inverse() * by_place;
  return {power.trace() / 2, (power(0, 0) - power(1, 1)) / 2, (power(0, 1) + power(1, 0)) / 2};
}

LandingSpots::LandingSpots(const EyeModel& eye, double wavelength_nm, double vertex_distance_mm,
                           const Lens& near)
    : best_(near) {
  const ExactTracer through_iris(eye, wavelength_nm), past_iris(with_pupil(eye, 20), wavelength_nm);
  constexpr int spokes = 72;
  constexpr double widest_mm = 4, edge_mm = 1e-4, step_D = 0.01;
  // The pupil's edge is where the iris cuts the parallel beam behind the lens, and stays with its rays.
  for (int round = 0; round < 4; ++round) {
    const auto behind = [&](const ExactTracer& tracer, const Lens& lens, const Vector2d& place) {
      return land(tracer, vertex_distance_mm, place, -1e-3 * power_matrix(lens) * place);
    };
    rays_.clear();
    double total = 0;
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double angle = 2 * pi * spoke / spokes;
      const Vector2d outward(std::cos(angle), std::sin(angle));
      double inside_mm = 0, outside_mm = widest_mm;
      while (outside_mm - inside_mm > edge_mm) {
        const double middle_mm = (inside_mm + outside_mm) / 2;
        (behind(through_iris, best_, middle_mm * outward) ? inside_mm : outside_mm) = middle_mm;
      }
      for (const Node& node : area_nodes) {
        const Vector2d place = inside_mm * std::sqrt(node.at) * outward;
        LandedRay ray;
        ray.weight = node.weight * inside_mm * inside_mm;
        ray.at_mm = behind(past_iris, best_, place).value();
        for (int k = 0; k < 3; ++k) {
          const Lens moved = best_ + step_D * Vector3d::Unit(k);
          ray.per_D_mm.col(k) = (behind(past_iris, moved, place).value() - ray.at_mm) / step_D;
        }
        rays_.push_back(ray);
        total += ray.weight;
      }
    }
    Vector2d mean = Vector2d::Zero();
    Eigen::Matrix<double, 2, 3> mean_slope = Eigen::Matrix<double, 2, 3>::Zero();
    for (LandedRay& ray : rays_) {
      ray.weight /= total;
      mean += ray.weight * ray.at_mm;
      mean_slope += ray.weight * ray.per_D_mm;
    }
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Vector3d right = Vector3d::Zero();
    for (LandedRay& ray : rays_) {
      ray.at_mm -= mean;
      ray.per_D_mm -= mean_slope;
      normal += ray.weight * ray.per_D_mm.transpose() * ray.per_D_mm;
      right += ray.weight * ray.per_D_mm.transpose() * ray.at_mm;
    }
    const Vector3d step = -normal.ldlt().solve(right);
    if (step.norm() < 1e-3) break;
    best_ += step;
  }
}

double LandingSpots::sharpness(const Lens& lens, double arcmin_per_mm) const {
  constexpr int frequencies = 16, directions = 6;
  constexpr double coarsest_cpd = 0.3, finest_cpd = 24, chart_finest_cpd = 20, blur_arcmin = 1;
  const Vector3d off = lens - best_;
  std::vector<Vector2d> at_deg;
  for (const LandedRay& ray : rays_)
    at_deg.emplace_back((ray.at_mm + ray.per_D_mm * off) * arcmin_per_mm / 60);
  double sum = 0, energy = 0;
  for (int d = 0; d < directions; ++d) {
    const Vector2d u(std::cos(pi * d / directions), std::sin(pi * d / directions));
    for (int k = 0; k < frequencies; ++k) {
      const double f = coarsest_cpd * std::pow(finest_cpd / coarsest_cpd, (k + 0.5) / frequencies);
      const double phase = 2 * pi * f * blur_arcmin / 60;
      // weight f^2, chart's power f^-3, area f df = f^2 d ln f
      const double weight = f * std::exp(-phase * phase - 2 * std::pow(f / chart_finest_cpd, 4));
      double re = 0, im = 0;
      for (std::size_t i = 0; i < rays_.size(); ++i) {
        const double angle = 2 * pi * f * u.dot(at_deg[i]);
        re += rays_[i].weight * std::cos(angle);
        im += rays_[i].weight * std::sin(angle);
      }
      sum += weight;
      energy += weight * (re * re + im * im);
    }
  }
  return energy / sum;
}

Lens LandingSpots::sharpest(double arcmin_per_mm) const {
  Lens best = best_;
  const auto search = [&](double reach_D, double step_D) {
    const Lens centre = best;
    double most = -1;
    const int n = static_cast<int>(std::lround(reach_D / step_D));
    for (int i = -n; i <= n; ++i)
      for (int j = -n; j <= n; ++j)
        for (int k = -n; k <= n; ++k) {
          const Lens lens = centre + step_D * Lens(i, j, k);
          const double value = sharpness(lens, arcmin_per_mm);
          if (value > most) {
            most = value;
            best = lens;
          }
        }
  };
  search(0.3, 0.1);
  search(0.1, 0.05);
  constexpr double step_D = 0.05;
  const double middle = sharpness(best, arcmin_per_mm);
  Lens vertex = best;
  for (int k = 0; k < 3; ++k) {
    const double below = sharpness(best - step_D * Lens::Unit(k), arcmin_per_mm),
                 above = sharpness(best + step_D * Lens::Unit(k), arcmin_per_mm);
    vertex[k] += step_D * (above - below) / (2 * (2 * middle - above - below));
  }
  return vertex;
}

double ClosedLoop::axis_error_deg() const {
  const auto axis_deg = [](const Lens& lens) { return std::atan2(lens[2], lens[1]) / degree / 2; };
  return std::abs(std::remainder(axis_deg(spot) - axis_deg(smallest_spot), 180));
}

ClosedLoop closed_loop(const raytrace::Tracer& tracer, const EyeModel& eye, double vertex_distance_mm) {
  constexpr double wavelength_nm = 589.3, pupil_mm = 3;
  const EyeModel seeing = with_pupil(eye, pupil_mm);
  ClosedLoop result;
  raytrace::WavefrontSettings wavefront;
  wavefront.wavelength_nm = wavelength_nm;
  const raytrace::RefractionCriteria criteria =
      raytrace::refraction_by_wavefront(seeing, wavefront, vertex_distance_mm);
  result.paraxial = as_vector(criteria.paraxial);
  result.spot = as_vector(criteria.minimum_rms_spot);
  result.paraxial_by_pencils = paraxial_by_pencils(seeing, wavelength_nm, vertex_distance_mm);
  const LandingSpots spots(seeing, wavelength_nm, vertex_distance_mm, result.paraxial_by_pencils);
  result.smallest_spot = spots.smallest_spot();
  result.sharpest_by_search = spots.sharpest(arcmin_per_mm(seeing, wavelength_nm));

  result.sharpest = Lens::Zero();
  const LensFamily family = thin_lens(vertex_distance_mm);
  const auto scene = refraction_chart();
  const auto levels = imaging_levels(SharpnessCriterion::gradient_energy, pupil_mm, wavelength_nm, {0, 0}, 1);
  for (const ImagingLevel& level : levels) {
    const RetinalSharpness sharpness(tracer, scene, eye, family, level);
    const bool last = &level == &levels.back();
    const Optimum optimum = ascend(sharpness, result.sharpest, last ? OptimiserSettings{} : coarse_search());
    result.sharpest = optimum.lens;
    result.converged = optimum.converged;
    result.images += sharpness.images();
  }
  return result;
}

}  // namespace emmetrope::correction
