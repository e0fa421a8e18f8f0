#pragma once
#include <string>
#include <vector>

#include "pipeline/report/content/numbers.hpp"

namespace emmetrope::report {

/// One line of the biometry table: where the number is in biometry.json, how it is written, what is normal in
/// adults.
struct BiometryRow {
  std::string key;  ///< path in biometry.json, '/' between levels
  std::string name;
  NumberStyle style;
  double low = 0, high = 0;  ///< normal range; equal where none is given
  std::string reference;     ///< number in the list of references; empty where there is no range
};

const std::vector<BiometryRow>& biometry_rows();
const std::vector<BiometryRow>& keratometry_rows();

}  // namespace emmetrope::report
