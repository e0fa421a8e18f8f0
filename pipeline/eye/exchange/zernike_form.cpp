#include "pipeline/eye/exchange/zernike_form.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

constexpr int order = 12, rings = 40, spokes = 72;
constexpr double smallest_mm = 1, step_mm = 0.1;

Eigen::Vector2d on_disc(double radius, int spoke) {
  const double angle = 2 * pi * spoke / spokes;
  return radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
}

bool reaches(const Shape& shape, double radius_mm) {
  for (int spoke = 0; spoke < spokes; ++spoke) {
    const Eigen::Vector2d at = on_disc(radius_mm, spoke);
    if (!shape.depth_mm(at.x(), at.y())) return false;
  }
  return true;
}

/// The asphericity of the conic of this vertex curvature through the rim (its mean depth there): what is left to the
/// Zernike terms is then small at both ends. A sphere's slope is infinite where the surface may be far from its own end,
/// which no polynomial follows.
double rim_asphericity(const Shape& shape, double curvature, double radius) {
  double rim_depth = 0;
  for (int spoke = 0; spoke < spokes; ++spoke) {
    const Eigen::Vector2d at = on_disc(radius, spoke);
    rim_depth += shape.depth_mm(at.x(), at.y()).value() / spokes;
  }
  if (!(rim_depth * curvature > 0)) return -1;  // no conic bends back; a paraboloid reaches everywhere
  return (2 * rim_depth / curvature - radius * radius) / (rim_depth * rim_depth) - 1;
}

double conic_depth(double curvature, double q, double radius) {
  const double square = radius * radius;
  return curvature * square / (1 + std::sqrt(std::max(0.0, 1 - (1 + q) * curvature * curvature * square)));
}

}  // namespace

ZernikeForm zernike_form(const Shape& shape, double radius_mm) {
  ZernikeForm form;
  form.curvature_per_mm = shape.vertex_curvature().trace() / 2;
  double radius = radius_mm;
  while (radius > smallest_mm && !reaches(shape, radius)) radius -= step_mm;
  if (radius <= smallest_mm) throw unsupported_error("the surface reaches less than 1 mm from its vertex");
  form.norm_radius_mm = radius;
  form.q = rim_asphericity(shape, form.curvature_per_mm, radius);
  Eigen::MatrixXd terms(rings * spokes, zernike_count(order));
  Eigen::VectorXd depth(rings * spokes);
  for (int ring = 0; ring < rings; ++ring)
    for (int spoke = 0; spoke < spokes; ++spoke) {
      // Rings of equal area, the last one the rim.
      const double rho = std::sqrt((ring + 1.0) / rings);
      const Eigen::Vector2d at = on_disc(rho, spoke);
      const int row = ring * spokes + spoke;
      terms.row(row) = zernike_values(order, at.x(), at.y()).transpose();
      const auto here = shape.depth_mm(radius * at.x(), radius * at.y());
      if (!here) throw unsupported_error("the surface has a hole within " + std::to_string(radius) + " mm");
      depth(row) = *here - conic_depth(form.curvature_per_mm, form.q, rho * radius);
    }
  const Eigen::VectorXd coefficients = terms.colPivHouseholderQr().solve(depth);
  form.coefficients_mm.assign(coefficients.begin(), coefficients.end());
  form.worst_um = 1000 * (terms * coefficients - depth).cwiseAbs().maxCoeff();
  return form;
}

int noll_number(int osa_index) {
  const auto [n, m] = zernike_index(osa_index);
  const bool early = n % 4 < 2;
  const bool first = m > 0 ? early : (m < 0 && !early);
  return n * (n + 1) / 2 + std::abs(m) + (first ? 0 : 1);
}

int sign_mirrored_in_x(int osa_index) {
  const int m = zernike_index(osa_index).m;
  const bool even = m % 2 == 0;
  return (m >= 0) == even ? 1 : -1;
}

}  // namespace emmetrope
