#include "raytrace/picture/airy.hpp"

#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int airy_steps = 1024;  // AIRY_STEPS in kernels/light.cl

double outside(double v) {
  const double j0 = std::cyl_bessel_j(0.0, v), j1 = std::cyl_bessel_j(1.0, v);
  return j0 * j0 + j1 * j1;
}

/// v beyond which the share `beyond` of the light lies; `outside` falls steadily.
double radius_of(double beyond) {
  double low = 0, high = 1;
  while (outside(high) > beyond) high *= 2;
  for (int i = 0; i < 60; ++i) (outside(0.5 * (low + high)) > beyond ? low : high) = 0.5 * (low + high);
  return 0.5 * (low + high);
}

}  // namespace

std::vector<float> airy_table(const std::array<double, wavelength_count>& wavelength_nm, double pupil_mm) {
  std::vector<float> table;
  for (const double nm : wavelength_nm) table.push_back(static_cast<float>(nm * 1e-6 / (pi * pupil_mm)));
  for (int i = 0; i < airy_steps; ++i) {
    const double beyond = 1 - static_cast<double>(i) * i / (static_cast<double>(airy_steps) * airy_steps);
    table.push_back(static_cast<float>(radius_of(beyond) * beyond));
  }
  table.push_back(static_cast<float>(2 / pi));  // the far rings: outside(v) -> 2 / (pi v)
  return table;
}

}  // namespace emmetrope::raytrace
