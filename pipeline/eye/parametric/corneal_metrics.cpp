#include "pipeline/eye/parametric/corneal_metrics.hpp"

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/quadrature.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

constexpr double asphericity_zone_mm = 8;

/// Maximum of a smooth function of an angle near a sample of it, by golden section.
template <typename Function>
double maximise(const Function& f, double lo, double hi) {
  const double ratio = (std::sqrt(5.0) - 1) / 2;
  double a = hi - ratio * (hi - lo), b = lo + ratio * (hi - lo);
  double fa = f(a), fb = f(b);
  while (hi - lo > 1e-8) {
    if (fa > fb) {
      hi = b, b = a, fb = fa;
      a = hi - ratio * (hi - lo), fa = f(a);
    } else {
      lo = a, a = b, fa = fb;
      b = lo + ratio * (hi - lo), fb = f(b);
    }
  }
  return (lo + hi) / 2;
}

double power_D(const CornealDepth& depth, double azimuth_rad) {
  // A meridian has two halves; on a surface without symmetry they are averaged.
  const double one = keratometric_D_mm / axial_radius_mm(depth, keratometry_ring_mm, azimuth_rad);
  const double other = keratometric_D_mm / axial_radius_mm(depth, keratometry_ring_mm, azimuth_rad + pi);
  return (one + other) / 2;
}

/// The meridian in [0, pi) where `sign` times the power is largest.
double extreme_meridian(const CornealDepth& depth, double sign) {
  constexpr int samples = 36;
  const auto f = [&](double azimuth) { return sign * power_D(depth, azimuth); };
  int best = 0;
  for (int i = 1; i < samples; ++i) {
    if (f(i * pi / samples) > f(best * pi / samples)) best = i;
  }
  return maximise(f, (best - 1) * pi / samples, (best + 1) * pi / samples);
}

}  // namespace

CornealDepth anterior_cornea(const ParametricEye& eye) {
  return [&eye](double x_mm, double y_mm) { return eye.cornea_anterior_depth_mm(x_mm, y_mm); };
}

double axial_radius_mm(const CornealDepth& depth, double r_mm, double azimuth_rad) {
  const double c = std::cos(azimuth_rad), s = std::sin(azimuth_rad);
  const double h = 1e-3;  // fourth-order difference: error about h^4 d^(5)/30, under 1e-14
  const auto d = [&](double r) { return depth(r * c, r * s); };
  const double slope = (8 * (d(r_mm + h) - d(r_mm - h)) - (d(r_mm + 2 * h) - d(r_mm - 2 * h))) / (12 * h);
  return r_mm * std::sqrt(1 + slope * slope) / slope;
}

CornealPower corneal_power(const CornealDepth& depth) {
  const double flat_azimuth = extreme_meridian(depth, -1);
  const double flat_D = power_D(depth, flat_azimuth);
  const double steep_D = power_D(depth, extreme_meridian(depth, 1));
  const double half_cylinder = (steep_D - flat_D) / 2;
  return {(steep_D + flat_D) / 2, half_cylinder * std::cos(2 * flat_azimuth),
          half_cylinder * std::sin(2 * flat_azimuth)};
}

double asphericity(const CornealDepth& depth) {
  constexpr int meridians = 36, samples = 40;
  double sum = 0;
  for (int m = 0; m < meridians; ++m) {
    const double azimuth = m * pi / meridians;
    // On a conic r^2 = 2 R d - (1 + Q) d^2: linear in R and 1 + Q. Both halves of the meridian count.
    Eigen::MatrixX2d basis(2 * samples, 2);
    Eigen::VectorXd r2(2 * samples);
    for (int i = 0; i < 2 * samples; ++i) {
      const int ring = i / 2 + 1;
      const double r = asphericity_zone_mm / 2 * ring / samples * (i % 2 == 0 ? 1 : -1);
      const double d = depth(r * std::cos(azimuth), r * std::sin(azimuth));
      basis.row(i) << 2 * d, -d * d;
      r2[i] = r * r;
    }
    sum += basis.colPivHouseholderQr().solve(r2)[1] - 1;
  }
  return sum / meridians;
}

double section_width_mm(const CornealDepth& depth, double depth_mm, double azimuth_rad) {
  double width = 0;
  for (const double side : {0.0, pi}) {
    const auto d = [&](double r) {
      return depth(r * std::cos(azimuth_rad + side), r * std::sin(azimuth_rad + side));
    };
    double lo = 0, hi = 0;
    // Beyond its equator a conic has no depth: NaN compares false and counts as deep enough.
    do {
      lo = hi;
      hi += 0.1;
      if (hi > 9)
        throw no_result_error("the fitted cornea is flatter than any: it does not reach " +
                              std::to_string(depth_mm) + " mm of depth");
    } while (d(hi) < depth_mm);
    for (int i = 0; i < 60; ++i) {
      const double middle = (lo + hi) / 2;
      (d(middle) < depth_mm ? lo : hi) = middle;
    }
    width += (lo + hi) / 2;
  }
  return width;
}

Eigen::VectorXd corneal_zernike_um(const CornealDepth& depth, double zone_mm, int order) {
  constexpr int rings = 16, spokes = 32;
  const auto [node, weight] =
      gauss_legendre(rings);  // in the square of the radius, in which a disc's area is even
  Eigen::VectorXd coefficients = Eigen::VectorXd::Zero(zernike_count(order));
  for (int i = 0; i < rings; ++i) {
    const double rho = std::sqrt(node[i]);
    for (int k = 0; k < spokes; ++k) {
      const double x = rho * std::cos(2 * pi * k / spokes), y = rho * std::sin(2 * pi * k / spokes);
      const double height_um = -1000 * depth(x * zone_mm / 2, y * zone_mm / 2);
      coefficients += weight[i] / spokes * height_um * zernike_values(order, x, y);
    }
  }
  return coefficients;
}

}  // namespace emmetrope
