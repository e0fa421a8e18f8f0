#pragma once
#include <algorithm>

namespace emmetrope::raytrace {

/// Power of the front surface that a ground spectacle lens gets by Vogel's rule: its mean power + 6 D for plus,
/// half of it + 6 D for minus, as far as blanks go.
inline double base_by_vogel_D(double mean_power_D) {
  return std::clamp(mean_power_D > 0 ? mean_power_D + 6 : mean_power_D / 2 + 6, 0.5, 12.0);
}

}  // namespace emmetrope::raytrace
