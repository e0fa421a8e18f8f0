#include "tests/correction/closed_loop.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "correction/prescription.hpp"
#include "correction/refraction_chart.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/eye/exact_trace.hpp"

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

Vector3d as_vector(const PowerVector& power) { return {power.M_D, power.J0_D, power.J45_D}; }

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
  const ExactTracer tracer(eye, wavelength_nm);
  constexpr int across = 22;
  constexpr double half_width_mm = 2.6, step_D = 0.01;
  // The pupil's edge is where the parallel beam is cut behind the last lens, and stays with its rays.
  for (int round = 0; round < 4; ++round) {
    landed_mm_.clear();
    per_D_mm_.clear();
    for (int row = 0; row < across; ++row)
      for (int column = 0; column < across; ++column) {
        const Vector2d place =
            half_width_mm * Vector2d((2 * column + 1.0) / across - 1, (2 * row + 1.0) / across - 1);
        const auto behind = [&](const Lens& lens) {
          return land(tracer, vertex_distance_mm, place, -1e-3 * power_matrix(lens) * place);
        };
        const auto landed = behind(best_);
        if (!landed) continue;
        Eigen::Matrix<double, 2, 3> slope;
        bool whole = true;
        for (int k = 0; k < 3; ++k) {
          const auto moved = behind(best_ + step_D * Vector3d::Unit(k));
          whole = whole && moved;
          if (moved) slope.col(k) = (*moved - *landed) / step_D;
        }
        if (!whole) continue;
        landed_mm_.push_back(*landed);
        per_D_mm_.push_back(slope);
      }
    const double count = static_cast<double>(landed_mm_.size());
    Vector2d mean = Vector2d::Zero();
    Eigen::Matrix<double, 2, 3> mean_slope = Eigen::Matrix<double, 2, 3>::Zero();
    for (std::size_t i = 0; i < landed_mm_.size(); ++i) {
      mean += landed_mm_[i] / count;
      mean_slope += per_D_mm_[i] / count;
    }
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Vector3d right = Vector3d::Zero();
    for (std::size_t i = 0; i < landed_mm_.size(); ++i) {
      landed_mm_[i] -= mean;
      per_D_mm_[i] -= mean_slope;
      normal += per_D_mm_[i].transpose() * per_D_mm_[i];
      right += per_D_mm_[i].transpose() * landed_mm_[i];
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
  for (std::size_t i = 0; i < landed_mm_.size(); ++i)
    at_deg.emplace_back((landed_mm_[i] + per_D_mm_[i] * off) * arcmin_per_mm / 60);
  double sum = 0, energy = 0;
  for (int d = 0; d < directions; ++d) {
    const Vector2d u(std::cos(pi * d / directions), std::sin(pi * d / directions));
    for (int k = 0; k < frequencies; ++k) {
      const double f = coarsest_cpd * std::pow(finest_cpd / coarsest_cpd, (k + 0.5) / frequencies);
      const double phase = 2 * pi * f * blur_arcmin / 60;
      // weight f^2, chart's power f^-3, area f df = f^2 d ln f
      const double weight = f * std::exp(-phase * phase - 2 * std::pow(f / chart_finest_cpd, 4));
      double re = 0, im = 0;
      for (const Vector2d& at : at_deg) {
        const double angle = 2 * pi * f * u.dot(at);
        re += std::cos(angle);
        im += std::sin(angle);
      }
      const double count = static_cast<double>(at_deg.size());
      sum += weight;
      energy += weight * (re * re + im * im) / (count * count);
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
  WavefrontSettings wavefront;
  wavefront.wavelength_nm = wavelength_nm;
  const RefractionCriteria criteria = refraction_by_wavefront(seeing, wavefront, vertex_distance_mm);
  result.paraxial = as_vector(criteria.paraxial);
  result.spot = as_vector(criteria.minimum_rms_spot);
  result.paraxial_by_pencils = paraxial_by_pencils(seeing, wavelength_nm, vertex_distance_mm);
  const LandingSpots spots(seeing, wavelength_nm, vertex_distance_mm, result.paraxial_by_pencils);
  result.smallest_spot = spots.smallest_spot();
  result.sharpest_by_search = spots.sharpest(arcmin_per_mm(seeing, wavelength_nm));

  result.sharpest = Lens::Zero();
  const LensFamily family = thin_lens(vertex_distance_mm);
  const auto scene = refraction_chart();
  const auto levels = imaging_levels(Measure::gradient_energy, pupil_mm, wavelength_nm, {0, 0}, 1);
  for (const ImagingLevel& level : levels) {
    const RetinalSharpness sharpness(tracer, scene, eye, family, level);
    const Optimum optimum = climb(std::cref(sharpness), result.sharpest, family.bounds, {});
    result.sharpest = optimum.lens;
    result.converged = optimum.converged;
    result.images += sharpness.images();
  }
  return result;
}

}  // namespace emmetrope::correction
