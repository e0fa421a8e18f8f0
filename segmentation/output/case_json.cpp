#include "segmentation/output/case_json.hpp"

#include "pipeline/base/frames.hpp"

namespace emmetrope::segmentation {
namespace {

Json stack_json(const StackChoice& choice, const SeriesInfo& series, const std::vector<HandLabels>& labels) {
  Json json{{"name", series.name},
            {"uid", series.uid},
            {"used", choice.used},
            {"contrast", choice.weighting.empty() ? Json(nullptr) : Json(choice.weighting)},
            {"reason", choice.reason}};
  for (const HandLabels& one : labels)
    if (one.stack == choice.stack) json["labels"] = one.input;
  return json;
}

Json eye_json(const JudgedEye& eye, const std::vector<const SeriesInfo*>& series) {
  Json used = Json::array();
  for (const JudgedEye* reading : eye.readings())
    for (const EyeView& view : reading->found.views) used.push_back(series[view.stack]->name);
  return {{"name", clinical_name(eye.found.laterality)},
          {"globe_centre_lps_mm", to_json_vector(eye.found.views.front().globe.centre)},
          {"stacks", used},
          {"contrast", to_string(eye.found.weighting)},
          {"evidence", to_string(eye.evidence)},
          {"status", eye.status()},
          {"reason", eye.reasons()}};
}

}  // namespace

Json case_json(const Subject& subject, const StudyInventory& inventory,
               const std::vector<const SeriesInfo*>& series, const FoundEyes& found,
               const std::vector<JudgedEye>& eyes, const std::vector<HandLabels>& labels,
               bool corneas_coupled) {
  Json json{{"subject", to_json(subject)}};
  json["series"] = Json::array();
  for (const SeriesInfo& info : inventory.series) json["series"].push_back(kept_json(info));
  json["stacks"] = Json::array();
  for (const StackChoice& choice : found.choices)
    json["stacks"].push_back(stack_json(choice, *series[choice.stack], labels));
  json["eyes"] = Json::object();
  for (const JudgedEye& eye : eyes) json["eyes"][to_string(eye.found.laterality)] = eye_json(eye, series);
  json["laterality"] = "by patient coordinates: the right eye is the globe at smaller LPS x";
  json["notes"] = found.notes;
  json["corneas_coupled"] = corneas_coupled;
  return json;
}

}  // namespace emmetrope::segmentation
