#include <fmt/format.h>

#include "segmentation/intake/study.hpp"

namespace emmetrope::segmentation {
namespace {

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json point(const Eigen::Vector3d& position) { return {position.x(), position.y(), position.z()}; }

std::string number(const std::optional<double>& value) { return value ? fmt::format("{:.6g}", *value) : "?"; }

}  // namespace

Json to_json(const SeriesInfo& series) {
  Json json{
      {"uid", series.uid},
      {"name", series.name},
      {"description", series.description},
      {"modality", series.modality},
      {"number", series.number},
      {"files", series.files},
      {"slices", series.slices.size()},
      {"rows", series.rows},
      {"columns", series.columns},
      {"row_spacing_mm", or_null(series.row_spacing_mm)},
      {"column_spacing_mm", or_null(series.column_spacing_mm)},
      {"slice_spacing_mm", or_null(series.slice_spacing_mm)},
      {"slice_thickness_mm", or_null(series.slice_thickness_mm)},
      {"uniform", series.uniform},
      {"orientation", series.row_spacing_mm ? Json(series.orientation) : Json(nullptr)},
      {"first_position_mm", series.slices.empty() ? Json(nullptr) : point(series.slices.front().position_mm)},
      {"last_position_mm", series.slices.empty() ? Json(nullptr) : point(series.slices.back().position_mm)},
      {"min", or_null(series.minimum)},
      {"max", or_null(series.maximum)},
      {"mean", or_null(series.mean)},
      {"transfer_syntax", series.transfer_syntax},
      {"study_uid", series.study_uid},
      {"frame_of_reference_uid", series.frame_of_reference_uid},
      {"image_type", series.image_type},
      {"acquisition_type", series.acquisition_type},
      {"body_part", series.body_part},
      {"laterality", series.image_laterality},
      {"repetition_time_ms", or_null(series.repetition_time_ms)},
      {"echo_time_ms", or_null(series.echo_time_ms)},
      {"inversion_time_ms", or_null(series.inversion_time_ms)},
      {"flip_angle_deg", or_null(series.flip_angle_deg)},
      {"field_strength_T", or_null(series.field_strength_T)},
      {"warnings", series.warnings},
      {"usable", series.usable},
      {"reason", series.reason}};
  return json;
}

Json kept_json(const SeriesInfo& series) {
  Json json = to_json(series);
  json["description"] = series.kept.description;
  json["warnings"] = series.kept.warnings;
  json["reason"] = series.kept.reason;
  return json;
}

Json to_json(const Subject& subject) {
  return {{"id", subject.id}, {"age_years", or_null(subject.age_years)}, {"sex", subject.sex}};
}

Json to_json(const StudyInventory& inventory) {
  Json series = Json::array(), skipped = Json::array();
  for (const auto& info : inventory.series) {
    const std::string why = inventory.why_not_used(info);
    series.push_back(to_json(info));
    series.back()["usable"] = why.empty();
    series.back()["reason"] = why;
  }
  for (const auto& file : inventory.skipped)
    skipped.push_back({{"file", file.file.string()}, {"reason", file.reason}});
  const Subject subject =
      inventory.series.empty() ? Subject{} : inventory.subject_of(inventory.series.front());
  return {{"series", series}, {"skipped", skipped}, {"subject", to_json(subject)}};
}

std::string describe(const StudyInventory& inventory) {
  std::string text;
  for (const auto& series : inventory.series) {
    text +=
        fmt::format("{}  {}  {}\n  uid {}\n", series.name, series.modality, series.description, series.uid);
    text += fmt::format(
        "  {} files, {} slices of {} x {}; row {} x column {} mm, slices {} mm apart, {} mm thick\n",
        series.files, series.slices.size(), series.rows, series.columns, number(series.row_spacing_mm),
        number(series.column_spacing_mm), number(series.slice_spacing_mm), number(series.slice_thickness_mm));
    text += fmt::format("  TR {} ms, TE {} ms; values {} to {}, mean {}\n", number(series.repetition_time_ms),
                        number(series.echo_time_ms), number(series.minimum), number(series.maximum),
                        number(series.mean));
    for (const auto& warning : series.warnings) text += "  warning: " + warning + "\n";
    const std::string why = inventory.why_not_used(series);
    text += why.empty() ? "  usable\n" : "  NOT usable: " + why + "\n";
  }
  if (inventory.series.empty()) text += "no series\n";
  if (!inventory.skipped.empty()) text += "skipped\n";
  for (const auto& file : inventory.skipped)
    text += fmt::format("  {}: {}\n", file.file.string(), file.reason);
  return text;
}

}  // namespace emmetrope::segmentation
