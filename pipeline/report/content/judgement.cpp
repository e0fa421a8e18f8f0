#include "pipeline/report/content/judgement.hpp"

#include "pipeline/eye/population/limits.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/normal_ranges.hpp"

namespace emmetrope::report {
namespace {

constexpr double repeatability_D = 0.5;  ///< what clinics ask of a refraction's 95 % limits of agreement
constexpr double dispensing_D = 1.0;     ///< beyond it a lens may be worse than the one that is worn
constexpr double astigmatism_D = 0.5;    ///< half width of J0 or J45: a cylinder of 1 D may not be there

/// Half of the 95 % interval of a number of the prescription; 0 where it has none.
double half_width(const EyeData& eye, const char* key) {
  const Json found = eye.prescription.value(key, Json());
  if (!found.is_object() || !found.contains("ci95")) return 0;
  const auto measured = found.get<Measured>();
  return (measured.ci95[1] - measured.ci95[0]) / 2;
}

/// " Known from elsewhere, refraction +-0.25 D would narrow it to +-0.49 D; optical axial length would not.":
/// what the correction stage found that each measurement would leave of M, the most telling first.
std::string remedy_for(const EyeData& eye) {
  constexpr double worth_telling = 0.95;
  std::vector<std::pair<double, std::string>> left;
  for (const auto& line : eye.prescription.value("if_measured", Json::array()))
    if (const auto sigma_D = value_of(line, "M_D"))
      left.emplace_back(Measured::from_sigma(0, *sigma_D, "").ci95[1],
                        with_symbols(line.value("measurement", std::string("a measurement"))));
  std::sort(left.begin(), left.end());
  std::string useful, useless;
  for (const auto& [half_width_D, measurement] : left) {
    if (half_width_D < worth_telling * half_width(eye, "M_D"))
      useful += (useful.empty() ? measurement + " would narrow it to" : ", " + measurement + " to") +
                " \u00b1" + fixed(half_width_D, 2) + " D";
    else
      useless += (useless.empty() ? "" : " and ") + measurement;
  }
  if (useful.empty()) return {};
  return " Known from elsewhere, " + useful + (useless.empty() ? "" : "; " + useless + " would not") + ".";
}

std::vector<std::string> failed_gates(const EyeData& eye) {
  std::vector<std::string> reasons;
  if (!eye.fit.is_object()) return reasons;
  for (const auto& gate : eye.fit.value("quality", Json::array()))
    if (!gate.value("passed", true))
      reasons.push_back(gate.value("reason", gate.value("name", "a gate failed")));
  return reasons;
}

/// Reasons that a stage gave, once each and without those that only concern the other eye.
void add_stage_reasons(const CaseData& data, const EyeData& eye, std::vector<std::string>& reasons) {
  const Laterality other = eye.laterality == Laterality::od ? Laterality::os : Laterality::od;
  const std::string own = std::string(clinical_name(eye.laterality)) + ": ";
  for (const auto& stage : data.stages)
    for (const auto& given : stage.reasons) {
      if (given.rfind(to_string(other), 0) == 0 || given.rfind(clinical_name(other), 0) == 0) continue;
      const std::string reason = given.rfind(own, 0) == 0 ? given.substr(own.size()) : given;
      if (std::find(reasons.begin(), reasons.end(), reason) == reasons.end()) reasons.push_back(reason);
    }
}

Judgement refused(const CaseData& data, const EyeData& eye, std::vector<std::string> reasons) {
  add_stage_reasons(data, eye, reasons);
  if (reasons.empty())
    reasons.emplace_back("The stages before this report gave no prescription for this eye.");
  return {Light::red, "No prescription: the images do not support one", reasons, false, false};
}

/// The first stage that was told to work on the other eye only.
const StageData* stage_of_other_eye(const CaseData& data, const EyeData& eye) {
  const char* other = to_string(eye.laterality == Laterality::od ? Laterality::os : Laterality::od);
  const auto found = std::find_if(data.stages.begin(), data.stages.end(), [&](const StageData& stage) {
    return stage.provenance.value("/parameters/laterality"_json_pointer, std::string("both")) == other;
  });
  return found == data.stages.end() ? nullptr : &*found;
}

/// A refraction that was given and hardly belongs to this eye.
std::vector<std::string> contradictions(const EyeData& eye) {
  const auto surprise = value_at(eye.prescription, "/calibration/surprise_sigma"),
             limit = value_at(eye.prescription, "/calibration/surprise_limit_sigma");
  if (!surprise || !limit || *surprise <= *limit) return {};
  return {
      "The refraction that was given and the images differ by " + fixed(*surprise, 1) +
      " standard deviations: it may be another eye's, have the wrong sign, or one of the two is wrong. What "
      "is combined from them is not to be relied on."};
}

const Json* at_path(const Json& json, const std::string& path) {
  const Json::json_pointer pointer("/" + path);
  return json.is_object() && json.contains(pointer) ? &json.at(pointer) : nullptr;
}

}  // namespace

std::vector<std::string> unusual_values(const EyeData& eye) {
  std::vector<std::string> sentences;
  for (const auto* rows : {&biometry_rows(), &keratometry_rows()})
    for (const auto& row : *rows) {
      const Json* found = at_path(eye.biometry, row.key);
      if (found == nullptr || row.low == row.high) continue;
      const double value = found->is_object() ? found->value("value", row.low) : found->get<double>();
      if (value < row.low || value > row.high)
        sentences.push_back(row.name + " " + format(value, row.style) + " is outside the adult range of " +
                            fixed(row.low, row.style.decimals) + " to " + format(row.high, row.style) + ".");
    }
  return sentences;
}

Judgement judge(const CaseData& data, const EyeData& eye) {
  const std::vector<std::string> gates = failed_gates(eye);
  if (const StageData* stage = stage_of_other_eye(data, eye)) {
    std::vector<std::string> reasons = gates;
    reasons.push_back("The " + stage->name + " stage was run for the other eye only.");
    return {Light::red, "No prescription: not asked for", reasons, false, false};
  }
  const bool fit_refused = eye.fit.is_object() && eye.fit.value("status", "measured") == "refused";
  const bool was_corrected = data.stage("correction") != nullptr;
  if (!fit_refused && !was_corrected && data.stage("segmentation")->status != ExitStatus::no_result)
    return {Light::red, "No prescription: the correction stage has not been run", gates, false, false};
  if (fit_refused || !eye.prescription.is_object() || !value_of(eye.prescription, "sphere_D"))
    return refused(data, eye, gates);

  std::vector<std::string> reasons = gates;
  const double M_half_width = half_width(eye, "M_D");
  const bool may_be_prescribed = M_half_width <= widest_prescription_D;
  if (!may_be_prescribed)
    reasons.insert(
        reasons.begin(),
        "The mean sphere's 95 % interval, \u00b1" + fixed(M_half_width, 2) +
            " D, is wider than from no lens at all to high myopia (6 D): these data do not support "
            "a prescription. The estimate is for information." +
            remedy_for(eye));
  else if (M_half_width > repeatability_D)
    reasons.push_back("The mean sphere's 95 % interval is \u00b1" + fixed(M_half_width, 2) +
                      " D; clinical refraction is expected to repeat within \u00b10.50 D." + remedy_for(eye));
  const std::vector<std::string> contradicted = contradictions(eye);
  reasons.insert(reasons.begin(), contradicted.begin(), contradicted.end());
  if (std::max(half_width(eye, "J0_D"), half_width(eye, "J45_D")) > astigmatism_D)
    reasons.push_back("Cylinder and axis are not determined: the 95 % intervals of J0 and J45 are \u00b1" +
                      fixed(half_width(eye, "J0_D"), 2) + " and \u00b1" + fixed(half_width(eye, "J45_D"), 2) +
                      " D.");
  for (auto& sentence : unusual_values(eye)) reasons.push_back(std::move(sentence));
  const auto roll = value_of(eye.biometry, "head_roll_deg");
  if (roll && std::abs(*roll) > largest_head_roll_deg)
    reasons.push_back("The head is rolled by " + fixed(*roll, 1) +
                      "\u00b0 against the scanner; astigmatic axes are given against the scanner.");
  add_stage_reasons(data, eye, reasons);
  if (!may_be_prescribed)
    return {Light::red, "No prescription: known only to \u00b1" + fixed(M_half_width, 1) + " D", reasons,
            true, false};
  if (reasons.empty()) return {Light::green, "Supported by the data", {}, true, true};
  return {Light::amber,
          M_half_width > dispensing_D ? "Estimate: refract before dispensing" : "Use with caution", reasons,
          true, true};
}

}  // namespace emmetrope::report
