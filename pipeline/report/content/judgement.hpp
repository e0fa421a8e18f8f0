#pragma once
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/document.hpp"

namespace emmetrope::report {

/// May this eye's prescription be trusted?
struct Judgement {
  Light light = Light::red;
  std::string verdict;               ///< one phrase
  std::vector<std::string> reasons;  ///< why it is not green; first the weightiest
  bool has_refraction = false;       ///< there is a refraction to show, if only for information
  bool has_prescription = false;     ///< and one that may stand as a prescription
};

/// The gate between what was measured and what may be called a prescription, in this one place.
/// Red: a stage refused, there is no refraction, or the 95 % interval of the mean sphere is wider than
/// +-`widest_prescription_D`. Amber: a gate or a plausibility check complains, or the interval is wider than
/// the +-0.5 D within which clinical refractions are expected to repeat. Green: neither.
Judgement judge(const CaseData& data, const EyeData& eye);

/// An interval of 6 D reaches from an eye that needs no lens to a highly myopic one (-6 D, International
/// Myopia Institute 2019): such a result does not even tell the class of the ametropia.
inline constexpr double widest_prescription_D = 3.0;

/// Values outside the range that is normal in adults: one sentence each.
std::vector<std::string> unusual_values(const EyeData& eye);

}  // namespace emmetrope::report
