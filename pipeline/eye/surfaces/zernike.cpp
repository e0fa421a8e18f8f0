#include "pipeline/eye/surfaces/zernike.hpp"

#include <cmath>
#include <complex>
#include <cstdlib>

namespace emmetrope {
namespace {

/// R_n^m(rho) = rho^m P(rho^2): P and its derivative with respect to rho^2, by Horner over the factorial
/// formula.
struct RadialFactor {
  double value = 0, derivative = 0;
};

RadialFactor radial_factor(int n, int m, double rho_squared) {
  const int half = (n - m) / 2;
  // Coefficient of rho^(n - 2s): (-1)^s (n - s)! / (s! ((n + m)/2 - s)! ((n - m)/2 - s)!)
  double coefficient = 1;  // s = 0: binomial(n, (n - m)/2)
  for (int k = 1; k <= half; ++k) coefficient *= static_cast<double>(n - half + k) / k;
  RadialFactor result;
  for (int s = 0; s <= half; ++s) {
    result.derivative = result.derivative * rho_squared + result.value;
    result.value = result.value * rho_squared + coefficient;
    if (s < half)
      coefficient *=
          -static_cast<double>((n + m) / 2 - s) * (half - s) / (static_cast<double>(n - s) * (s + 1));
  }
  return result;
}

/// std::pow of a complex number goes through logarithms.
std::complex<double> power(std::complex<double> z, int exponent) {
  std::complex<double> result = 1;
  for (int i = 0; i < exponent; ++i) result *= z;
  return result;
}

double normalisation(int n, int m) { return std::sqrt((m == 0 ? 1.0 : 2.0) * (n + 1)); }

}  // namespace

ZernikeIndex zernike_index(int j) {
  int n = static_cast<int>((-1 + std::sqrt(1 + 8.0 * j)) / 2);
  while (zernike_count(n) <= j) ++n;
  return {n, 2 * j - n * (n + 2)};
}

ZernikeJet zernike_jet(int j, double x, double y) {
  const auto [n, m] = zernike_index(j);
  const int order = std::abs(m);
  const RadialFactor radial = radial_factor(n, order, x * x + y * y);
  // rho^m cos(m theta) and rho^m sin(m theta) are the parts of (x + iy)^m, smooth at the centre.
  const std::complex<double> z(x, y);
  const std::complex<double> turned = power(z, order);
  const std::complex<double> slope = order == 0 ? 0.0 : static_cast<double>(order) * power(z, order - 1);
  const double harmonic = m < 0 ? turned.imag() : turned.real();
  const double harmonic_x = m < 0 ? slope.imag() : slope.real();
  const double harmonic_y = m < 0 ? slope.real() : -slope.imag();
  const double norm = normalisation(n, m);
  return {norm * radial.value * harmonic,
          norm * Eigen::Vector2d(radial.derivative * 2 * x * harmonic + radial.value * harmonic_x,
                                 radial.derivative * 2 * y * harmonic + radial.value * harmonic_y)};
}

Eigen::VectorXd zernike_values(int order, double x, double y) {
  Eigen::VectorXd result(zernike_count(order));
  for (int j = 0; j < result.size(); ++j) {
    const auto [n, m] = zernike_index(j);
    const std::complex<double> turned = power({x, y}, std::abs(m));
    result[j] = normalisation(n, m) * radial_factor(n, std::abs(m), x * x + y * y).value *
                (m < 0 ? turned.imag() : turned.real());
  }
  return result;
}

Eigen::VectorXd turned_zernike(const Eigen::VectorXd& coefficients, double angle_rad) {
  Eigen::VectorXd result = coefficients;
  for (int j = 0; j < coefficients.size(); ++j) {
    const int m = zernike_index(j).m;
    if (m <= 0) continue;
    const int partner = j - m;  // (n, -m), since j = (n (n + 2) + m) / 2
    const double c = coefficients[j], s = coefficients[partner];
    result[j] = c * std::cos(m * angle_rad) + s * std::sin(m * angle_rad);
    result[partner] = s * std::cos(m * angle_rad) - c * std::sin(m * angle_rad);
  }
  return result;
}

}  // namespace emmetrope
