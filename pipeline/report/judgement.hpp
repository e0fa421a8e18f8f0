#pragma once
#include "pipeline/report/case_data.hpp"
#include "pipeline/report/document.hpp"

namespace emmetrope::report {

/// May this eye's prescription be trusted?
struct Judgement {
  Light light = Light::red;
  std::string verdict;               ///< one phrase
  std::vector<std::string> reasons;  ///< why it is not green; first the weightiest
  bool has_prescription = false;     ///< red eyes have none, whatever the files hold
};

/// Red: a stage refused, or there is no prescription. Amber: a gate or a plausibility check complains, or the
/// 95 % interval of the mean sphere is wider than the +-0.5 D within which subjective refractions repeat.
/// Green: neither.
Judgement judge(const CaseData& data, const EyeData& eye);

/// Values outside the range that is normal in adults: one sentence each.
std::vector<std::string> unusual_values(const EyeData& eye);

}  // namespace emmetrope::report
