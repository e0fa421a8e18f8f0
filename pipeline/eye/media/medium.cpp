#include "pipeline/eye/media/medium.hpp"

#include <cmath>

namespace emmetrope {
namespace {

// Wavelengths in um but where a formula says nm.

double cauchy(const std::vector<double>& c, double um) {
  double sum = 0, power = 1;
  for (const double term : c) {
    sum += term * power;
    power /= um * um;
  }
  return sum;
}

double conrady(const std::vector<double>& c, double um) {
  return c[0] + c[1] / um + c[2] / std::pow(um, 3.5);
}

double cornu(const std::vector<double>& c, double nm) { return c[0] + c[1] / (nm - c[2]); }

double herzberger(const std::vector<double>& c, double um) {
  const double l = 1 / (um * um - 0.1673 * 0.1673);
  return c[0] + c[1] * um * um + c[2] * l + c[3] * l * l;
}

double sellmeier(const std::vector<double>& c, double um) {
  double square = 1;
  for (std::size_t k = 0; k + 1 < c.size(); k += 2) square += c[k] * um * um / (um * um - c[k + 1]);
  return std::sqrt(square);
}

double schott(const std::vector<double>& c, double um) {
  const double square = um * um;
  return std::sqrt(c[0] + c[1] * square +
                   (c[2] + (c[3] + (c[4] + c[5] / square) / square) / square) / square);
}

double polynomial(const std::vector<double>& c, double um) {
  double sum = 0;
  for (std::size_t k = c.size(); k-- > 0;) sum = sum * um + c[k];
  return sum;
}

/// Cauchy's two terms through n_d and the Abbe number V = (n_d - 1) / (n_F - n_C).
double abbe(const std::vector<double>& c, double um) {
  constexpr double d_um = 0.5875618, f_um = 0.4861327, c_um = 0.6562725;
  const double slope = (c[0] - 1) / c[1] / (1 / (f_um * f_um) - 1 / (c_um * c_um));
  return c[0] + slope * (1 / (um * um) - 1 / (d_um * d_um));
}

/// Pairs (nm, n) with wavelengths ascending: linear in 1 / wavelength^2, which dispersion nearly is, also
/// beyond the ends.
double table(const std::vector<double>& c, double nm) {
  const std::size_t rows = c.size() / 2;
  std::size_t k = 0;
  while (k + 2 < rows && nm > c[2 * (k + 1)]) ++k;
  const auto u = [](double wavelength) { return 1 / (wavelength * wavelength); };
  const double t = (u(nm) - u(c[2 * k])) / (u(c[2 * k + 2]) - u(c[2 * k]));
  return c[2 * k + 1] + t * (c[2 * k + 3] - c[2 * k + 1]);
}

}  // namespace

double Dispersion::formula_index(double wavelength_nm) const {
  const double um = wavelength_nm / 1000;
  switch (formula) {
    case Formula::constant:
      return 0;
    case Formula::cauchy:
      return cauchy(coefficients, um);
    case Formula::conrady:
      return conrady(coefficients, um);
    case Formula::cornu:
      return cornu(coefficients, wavelength_nm);
    case Formula::herzberger:
      return herzberger(coefficients, um);
    case Formula::sellmeier:
      return sellmeier(coefficients, um);
    case Formula::schott:
      return schott(coefficients, um);
    case Formula::polynomial:
      return polynomial(coefficients, um);
    case Formula::abbe:
      return abbe(coefficients, um);
    case Formula::table:
      return table(coefficients, wavelength_nm);
  }
  return 0;
}

double GradientIndex::index(double depth_mm, double radius_mm) const {
  double sum = 0;
  for (const Term& term : terms)
    sum += term.coefficient * std::pow(depth_mm, term.depth_power) * std::pow(radius_mm, term.radius_power);
  return sum;
}

double Medium::index_at(double wavelength_nm, double reference_wavelength_nm) const {
  if (wavelength_nm == reference_wavelength_nm) return index;
  return index + dispersion.formula_index(wavelength_nm) - dispersion.formula_index(reference_wavelength_nm);
}

double Medium::index_at(double depth_mm, double radius_mm, double wavelength_nm,
                        double reference_wavelength_nm) const {
  const double on_axis = index_at(wavelength_nm, reference_wavelength_nm);
  return gradient ? gradient->index(depth_mm, radius_mm) + on_axis - index : on_axis;
}

}  // namespace emmetrope
