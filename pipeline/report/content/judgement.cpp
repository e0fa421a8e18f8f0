#include "pipeline/report/content/judgement.hpp"

#include <fmt/format.h>

#include "pipeline/eye/population/limits.hpp"
#include "pipeline/report/content/biometry_rows.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/first_page.hpp"
#include "pipeline/report/content/learnt.hpp"
#include "pipeline/report/content/remedies.hpp"
#include "pipeline/report/content/said.hpp"

namespace emmetrope::report {
namespace {

/// Half of the 95 % interval of a number of the prescription; 0 where it has none.
double half_width(const Json& prescription, const char* key) {
  const auto measured = measured_in(prescription, key);
  return measured ? (measured->ci95[1] - measured->ci95[0]) / 2 : 0;
}

using Findings = std::vector<Finding>;

/// Those that withhold something before those that only warn.
Findings failed_gates(const EyeData& eye) {
  Findings withholding, warning;
  if (!eye.fit.is_object()) return {};
  for (const auto& gate : eye.fit.value("quality", Json::array())) {
    if (gate.value("passed", true)) continue;
    const std::string name = gate.value("name", "a gate");
    (gate.value("withholds", "nothing") == "nothing" ? warning : withholding)
        .push_back({gate.value("reason", name + " failed"), remedy_of_gate(name)});
  }
  withholding.insert(withholding.end(), warning.begin(), warning.end());
  return withholding;
}

/// Reasons that a stage gave, once each and without those that only concern the other eye.
void add_stage_reasons(const CaseData& data, const EyeData& eye, Findings& reasons) {
  const Laterality other = eye.laterality == Laterality::od ? Laterality::os : Laterality::od;
  const std::string own = std::string(clinical_name(eye.laterality)) + ": ";
  std::vector<std::string> said;
  for (const Finding& finding : reasons) said.push_back(finding.what);
  for (const auto& stage : data.stages)
    for (const auto& given : stage.reasons) {
      if (given.rfind(to_string(other), 0) == 0 || given.rfind(clinical_name(other), 0) == 0) continue;
      const std::string reason = given.rfind(own, 0) == 0 ? given.substr(own.size()) : given;
      if (is_said(reason, said)) continue;
      said.push_back(reason);
      reasons.push_back({reason, remedy_of_reason(stage.name, reason)});
    }
}

/// The first stage that was told to work on the other eye only.
const StageData* stage_of_other_eye(const CaseData& data, const EyeData& eye) {
  const char* other = to_string(eye.laterality == Laterality::od ? Laterality::os : Laterality::od);
  const auto found = std::find_if(data.stages.begin(), data.stages.end(), [&](const StageData& stage) {
    return stage.provenance.value("/parameters/laterality"_json_pointer, std::string("both")) == other;
  });
  return found == data.stages.end() ? nullptr : &*found;
}

/// Both refractions, of which no mean is told.
/// \param with  combined_with()
Finding contradiction_of(const Json& prescription, const std::string& with) {
  const Json& calibration = prescription.at("calibration");
  const Json alone = calibration.value("without_it", Json());
  return {
      "The refraction that was given, " + refraction_of(calibration.value("given", Json())) +
          light_of(prescription, sodium_light()) + ", and what " + with + " say, " + refraction_of(alone) +
          light_of(prescription, " (of {:g} nm)") +
          fmt::format(", both brought to a vertex distance of {:g} mm, differ by ",
                      value_of(prescription, "vertex_distance_mm").value_or(12)) +
          fixed(value_of(calibration, "surprise_sigma").value_or(0), 1) +
          " standard deviations: it may be another eye's, have the wrong sign, or one of the two is wrong.",
      "Check whose refraction it is, which eye's, and its sign; run correct again without it."};
}

/// What is to be said of a spherical equivalent with that interval.
Findings sphere_reasons(const EyeData& eye, const std::string& withheld) {
  const double half_width_D = half_width(eye.prescription, "M_D");
  if (!withheld.empty()) return {{withheld + " The estimate is for information.", "Refract."}};
  if (const std::string why = estimate_because(eye.prescription); !why.empty())
    return {{why, "Refract before dispensing."}};
  if (limits_of("M_half_width_D").normal.contains(half_width_D)) return {};
  return {{"The spherical equivalent's 95 % interval is \u00b1" + fixed(half_width_D, 1) +
               " D; clinical refraction is expected to repeat within \u00b10.5 D.",
           "Refract before dispensing."}};
}

Findings cylinder_reasons(const EyeData& eye) {
  const double J0_D = half_width(eye.prescription, "J0_D"), J45_D = half_width(eye.prescription, "J45_D");
  if (limits_of("J_half_width_D").plausible.contains(std::max(J0_D, J45_D))) return {};
  return {{(has_axis(eye.prescription.value("cylinder_D", Json()))
                ? std::string("The cylinder is known badly: the 95 % intervals of J0 and J45 are \u00b1")
                : std::string(
                      "Cylinder and axis are not determined: the 95 % intervals of J0 and J45 are \u00b1")) +
               fixed(J0_D, 1) + " and \u00b1" + fixed(J45_D, 1) + " D.",
           "Take cylinder and axis from refraction or keratometry."}};
}

Findings unusual_findings(const CaseData& data, const EyeData& eye) {
  Findings findings;
  for (const std::string& sentence : unusual_values(data, eye))
    findings.push_back({sentence, "Look whether the contours on the slices bear it out."});
  return findings;
}

Findings head_roll_reasons(const EyeData& eye) {
  const auto roll_deg = value_of(eye.biometry, "head_roll_deg");
  if (!roll_deg || limits_of("head_roll_deg").plausible.contains(*roll_deg)) return {};
  return {{"The head is rolled by " + fixed(*roll_deg, 1) +
               "\u00b0 against the scanner; astigmatic axes are given against the scanner.",
           "Turn axes by the roll before they are compared with a refraction."}};
}

/// All that is to be said of a refraction, the most dangerous first.
Findings reasons_of_refraction(const CaseData& data, const EyeData& eye, const Findings& gates,
                               const std::string& withheld) {
  const Findings sphere = sphere_reasons(eye, withheld);
  Findings reasons;
  const auto add = [&](const Findings& more) { reasons.insert(reasons.end(), more.begin(), more.end()); };
  if (!withheld.empty()) add(sphere);
  add(gates);
  if (withheld.empty()) add(sphere);
  add(cylinder_reasons(eye));
  add(unusual_findings(data, eye));
  add(head_roll_reasons(eye));
  add_stage_reasons(data, eye, reasons);
  return reasons;
}

/// Without a refraction.
Judgement no_prescription(std::string verdict, Findings reasons) {
  Judgement judgement;
  judgement.verdict = std::move(verdict);
  judgement.reasons = std::move(reasons);
  return judgement;
}

Judgement refused(const CaseData& data, const EyeData& eye, Findings reasons) {
  add_stage_reasons(data, eye, reasons);
  if (reasons.empty())
    reasons.push_back({"The stages before this report gave no prescription for this eye.", ""});
  return no_prescription("No prescription: the images do not support one", std::move(reasons));
}

Judgement contradicted(const CaseData& data, const EyeData& eye, const Findings& gates) {
  Findings reasons{contradiction_of(eye.prescription, combined_with(data, eye))};
  for (const Findings& more : {gates, unusual_findings(data, eye), head_roll_reasons(eye)})
    reasons.insert(reasons.end(), more.begin(), more.end());
  add_stage_reasons(data, eye, reasons);
  return no_prescription("No prescription: given and images contradict", std::move(reasons));
}

/// Of a refraction that was found.
Judgement judge_refraction(const CaseData& data, const EyeData& eye, const Findings& gates) {
  const std::string withheld = withheld_because(eye);
  const double M_half_width_D = half_width(eye.prescription, "M_D");
  Judgement judgement;
  judgement.reasons = reasons_of_refraction(data, eye, gates, withheld);
  judgement.has_refraction = true;
  judgement.has_prescription = withheld.empty();
  judgement.light = !withheld.empty() ? Light::red : judgement.reasons.empty() ? Light::green : Light::amber;
  switch (judgement.light) {
    case Light::red:
      judgement.verdict = "No prescription: known only to \u00b1" + fixed(M_half_width_D, 1) + " D";
      break;
    case Light::amber:
      judgement.verdict = estimate_because(eye.prescription).empty() ? "Use with caution"
                                                                     : "Estimate: refract before dispensing";
      break;
    case Light::green:
      judgement.verdict = eye.prescription.value("calibration", Json()).is_object()
                              ? "Supported, with the refraction that was given"
                              : "Supported by the data";
      break;
  }
  return judgement;
}

}  // namespace

bool is_contradicted(const Json& prescription) {
  const auto surprise = value_at(prescription, "/calibration/surprise_sigma"),
             limit = value_at(prescription, "/calibration/surprise_limit_sigma");
  return surprise && limit && *surprise > *limit;
}

std::string withheld_because(const EyeData& eye) {
  const Json said = eye.prescription.value("withheld", Json());
  if (said.is_string()) return with_symbols(said.get<std::string>());
  const double M_half_width_D = half_width(eye.prescription, "M_D");
  if (eye.prescription.contains("withheld") || limits_of("M_half_width_D").accepted.contains(M_half_width_D))
    return {};
  return "The spherical equivalent's 95 % interval, \u00b1" + fixed(M_half_width_D, 2) +
         " D, is too wide for a prescription.";
}

std::string estimate_because(const Json& prescription) {
  if (!measured_in(prescription, "M_D"))
    return "The spherical equivalent's interval is unknown: an estimate, do not dispense.";
  if (prescription.contains("estimate")) {
    const Json& said = prescription.at("estimate");
    return said.is_string() ? with_symbols(said.get<std::string>()) : std::string();
  }
  // Of a case that was corrected before the stage said so.
  if (limits_of("M_half_width_D").plausible.contains(half_width(prescription, "M_D"))) return {};
  return "The spherical equivalent is not known well enough: an estimate, do not dispense.";
}

std::string doubts_of(const EyeData& eye, const Judgement& judgement) {
  const std::string estimate = estimate_because(eye.prescription);
  std::string text = estimate;
  for (const Finding& finding : judgement.reasons) {
    if (finding.what == estimate) continue;
    text += (text.empty() ? "" : " ") + finding.what;
    if (text.back() != '.') text += '.';  // gates end without a full stop, sentences with one
  }
  return text;
}

std::vector<std::string> unusual_values(const CaseData& data, const EyeData& eye) {
  if (!data.has_normal_ranges) return {};
  const std::optional<double> age_years = data.age_years();
  const char* whose = is_child(age_years) ? "that age's" : "the adult";
  std::vector<std::string> sentences;
  for (const auto* rows : measured_rows())
    for (const auto& row : *rows) {
      const auto value = value_at(eye.biometry, "/" + row.key);
      if (value && !row.is_normal(*value, age_years))
        sentences.push_back(row.name + " " + format(*value, row.style) + " is outside " + whose +
                            " range of " + format_range(row.normal(age_years).range, row.style.decimals) +
                            (row.style.unit.empty() ? "" : " " + row.style.unit) + ".");
    }
  return sentences;
}

Judgement judge(const CaseData& data, const EyeData& eye) {
  const Findings gates = failed_gates(eye);
  if (const StageData* stage = stage_of_other_eye(data, eye)) {
    Findings reasons = gates;
    reasons.push_back({"The " + stage->name + " stage was run for the other eye only.", ""});
    return no_prescription("No prescription: not asked for", reasons);
  }
  // An eye whose cornea other instruments measured is partial and has a refraction all the same.
  const std::string segmented = eye.fit.is_object() ? eye.fit.value("status", "measured") : "measured";
  const bool is_incomplete = segmented == "refused" || (segmented == "partial" && !eye.optics.is_object());
  const bool was_corrected = data.stage("correction") != nullptr;
  if (!is_incomplete && !was_corrected && data.stage("segmentation")->status != ExitStatus::no_result)
    return no_prescription("No prescription: the correction stage has not been run", gates);
  if (is_incomplete || !eye.prescription.is_object() || !value_of(eye.prescription, "sphere_D"))
    return refused(data, eye, gates);
  if (is_contradicted(eye.prescription)) return contradicted(data, eye, gates);
  return judge_refraction(data, eye, gates);
}

}  // namespace emmetrope::report
