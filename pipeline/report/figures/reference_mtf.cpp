#include "pipeline/report/figures/reference_mtf.hpp"

#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::report {

double diffraction_mtf(double cpd, double pupil_mm, double wavelength_nm) {
  const double cutoff_cpd = pupil_mm / (wavelength_nm * 1e-6) * degree;
  const double u = cpd / cutoff_cpd;
  return u >= 1 ? 0 : 2 / pi * (std::acos(u) - u * std::sqrt(1 - u * u));
}

double healthy_mtf(double cpd, double pupil_mm) {
  constexpr double wavelength_nm = 555;
  const double d = pupil_mm, u1 = 21.95 - 5.512 * d + 0.3922 * d * d;
  return std::pow(1 + cpd * cpd / (u1 * u1), -0.62) * std::sqrt(diffraction_mtf(cpd, d, wavelength_nm));
}

}  // namespace emmetrope::report
