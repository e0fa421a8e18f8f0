#include "pipeline/eye/media/transmittance.hpp"

#include <cmath>

namespace emmetrope {
namespace {

/// A template's band, by its centre and its width's inverse.
double band(double wavelength_nm, double centre_nm, double per_nm) {
  const double t = per_nm * (wavelength_nm - centre_nm);
  return std::exp(-t * t);
}

}  // namespace

double ocular_transmittance(double wavelength_nm, double age_years, MediaField field) {
  const double square = age_years * age_years;
  const double scattered = field == MediaField::small ? 0.446 : 0.225;
  const double rayleigh = (scattered + 3.1e-5 * square) * std::pow(400 / wavelength_nm, 4),
               tryptophan = 14.19 * 10.68 * band(wavelength_nm, 273, 0.057),
               young_lens = (0.998 - 6.3e-5 * square) * 2.13 * band(wavelength_nm, 370, 0.029),
               old_lens_uv = (0.059 + 1.86e-4 * square) * 11.95 * band(wavelength_nm, 325, 0.021),
               old_lens = (0.016 + 1.32e-4 * square) * 1.43 * band(wavelength_nm, 325, 0.008),
               neutral = 0.111;
  return std::pow(10, -(rayleigh + tryptophan + young_lens + old_lens_uv + old_lens + neutral));
}

}  // namespace emmetrope
