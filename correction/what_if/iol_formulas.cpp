#include "correction/what_if/iol_formulas.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::correction {
namespace {

double radius_mm(const IolBiometry& biometry) { return keratometric_D_mm / biometry.keratometry_D; }

/// Height of a corneal cap of that radius over a chord.
double cap_height_mm(double radius, double chord_mm) {
  const double under_root = radius * radius - chord_mm * chord_mm / 4;
  if (under_root < 0)
    throw no_result_error("the formula has no corneal height for this axial length and keratometry");
  return radius - std::sqrt(under_root);
}

/// Where SRK/T and Haigis expect the lens of an average eye.
double acd_constant_mm(double a_constant) { return 0.62467 * a_constant - 68.747; }

}  // namespace

ThinLensEye srkt_eye(const IolBiometry& biometry, double a_constant) {
  const double length = biometry.axial_length_mm, radius = radius_mm(biometry);
  const double corrected = length <= 24.2 ? length : -3.446 + 1.716 * length - 0.0237 * length * length;
  const double width = -5.41 + 0.58412 * corrected + 0.098 * biometry.keratometry_D;
  constexpr double offset_mm = 3.336, retina_mm = 0.65696, retina_per_mm = 0.02029;
  return {length + retina_mm - retina_per_mm * length,
          cap_height_mm(radius, width) + acd_constant_mm(a_constant) - offset_mm, 333 / radius};
}

ThinLensEye holladay_eye(const IolBiometry& biometry, double a_constant) {
  const double radius = radius_mm(biometry);
  const double width = std::min(12.5 / 23.45 * biometry.axial_length_mm, 13.5);
  const double anatomic_mm = 0.56 + cap_height_mm(std::max(radius, 7.0), width);
  return {biometry.axial_length_mm + 0.2, anatomic_mm + 0.5663 * a_constant - 65.60, 1e3 / 3 / radius};
}

ThinLensEye hoffer_q_eye(const IolBiometry& biometry, double a_constant) {
  const double length = std::clamp(biometry.axial_length_mm, 18.5, 31.0);
  const bool is_short = biometry.axial_length_mm <= 23;
  const double from_mean = 23.5 - length, from_limit = (is_short ? 28 : 23.5) - length;
  const double acd_mm =
      0.58357 * a_constant - 63.896 + 0.3 * (length - 23.5) +
      std::pow(std::tan(biometry.keratometry_D * degree), 2) +
      (is_short ? 0.1 : -0.1) * from_mean * from_mean * std::tan(0.1 * from_limit * from_limit * degree) -
      0.99166;
  return {biometry.axial_length_mm, acd_mm + 0.05, biometry.keratometry_D};
}

ThinLensEye haigis_eye(const IolBiometry& biometry, double a_constant) {
  constexpr double a1 = 0.4, a2 = 0.1, mean_acd_mm = 3.37, mean_length_mm = 23.39;
  const double a0 = acd_constant_mm(a_constant) - a1 * mean_acd_mm - a2 * mean_length_mm;
  return {biometry.axial_length_mm,
          a0 + a1 * biometry.anterior_chamber_depth_mm + a2 * biometry.axial_length_mm,
          331.5 / radius_mm(biometry)};
}

double iol_power_D(const ThinLensEye& eye, double target_D) {
  constexpr double aqueous = 1336, vertex_mm = 12;
  const double at_cornea_D = target_D / (1 - 1e-3 * vertex_mm * target_D);
  return aqueous / (eye.length_mm - eye.lens_mm) -
         aqueous / (aqueous / (eye.cornea_D + at_cornea_D) - eye.lens_mm);
}

}  // namespace emmetrope::correction
