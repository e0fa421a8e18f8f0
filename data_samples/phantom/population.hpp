#pragma once
#include <vector>

namespace emmetrope::phantom {

/// A normal distribution cut off at its limits: one row of the population's table in docs/method/phantom.md.
struct Distribution {
  const char* name;  ///< a key of the geometry, or what it is derived from
  double mean;       ///< at 40 years
  double per_year;   ///< change of the mean with age
  double sd, low, high;
  const char* source;
};

/// What random heads are drawn from.
const std::vector<Distribution>& population();

}  // namespace emmetrope::phantom
