#pragma once
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// One gate: a number against its limit.
struct QualityGate {
  std::string name;
  double value = 0, limit = 0;
  bool passed = true;
  bool decides = true;  ///< whether failing it refuses the eye; else it is a warning
  std::string reason;   ///< why it failed, in the user's words; empty when passed
};

/// Judges a fit: globe inside the stack, lens and cornea seen, lengths determined, residuals explained,
/// shapes of an eye.
std::vector<QualityGate> judge_quality(const FoundEye& found, const EyeFit& fit);
bool is_refused(const std::vector<QualityGate>& gates);
Json to_json(const QualityGate& gate);

}  // namespace emmetrope::segmentation
