#pragma once
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/document/document.hpp"

namespace emmetrope::report {

/// May this eye's prescription be trusted?
struct Judgement {
  Light light = Light::red;
  std::string verdict;            ///< one phrase
  std::vector<Finding> reasons;   ///< why it is not green; the most dangerous first
  bool has_refraction = false;    ///< there is a refraction to show, if only for information
  bool has_prescription = false;  ///< and one that may stand as a prescription
};

/// Red: a stage refused, there is no refraction, the one that was given and the images contradict, or the correction
/// stage withholds the prescription. Amber: a
/// gate or a plausibility check complains, or the spherical equivalent's 95 % interval is unknown, or wider than that within
/// which clinical refractions are expected to repeat. Green: neither.
Judgement judge(const CaseData& data, const EyeData& eye);

/// Whether a refraction was given that hardly belongs to this eye: what is combined from it and the images is of neither.
bool is_contradicted(const Json& prescription);

/// Values outside the range that is normal at the person's age: one sentence each.
std::vector<std::string> unusual_values(const CaseData& data, const EyeData& eye);

/// Why no prescription is given; empty where one is.
/// \pre the eye has a refraction
std::string withheld_because(const EyeData& eye);
/// Why a refraction is an estimate that is not to be dispensed, as the correction stage says it, or for want of an
/// interval; empty where it is none.
std::string estimate_because(const Json& prescription);
/// What goes with a prescription wherever it goes: first that it is not to be dispensed, then all reasons of the
/// judgement; empty where there are none.
std::string doubts_of(const EyeData& eye, const Judgement& judgement);

}  // namespace emmetrope::report
