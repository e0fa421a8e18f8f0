#include "raytrace/wavefront/contrast_sensitivity.hpp"

#include <cmath>

namespace emmetrope::raytrace {

double contrast_sensitivity(double cpd) {
  constexpr double peak = 0.9809;  // of the formula, near 7.9 cycles per degree
  const double scaled = 0.114 * std::abs(cpd);
  return 2.6 * (0.0192 + scaled) * std::exp(-std::pow(scaled, 1.1)) / peak;
}

}  // namespace emmetrope::raytrace
