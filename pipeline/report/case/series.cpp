#include "pipeline/report/case/series.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include "pipeline/report/document/numbers.hpp"

namespace emmetrope::report {
namespace {

std::string text_of(const Json& json, const char* key) {
  const Json found = json.is_object() ? json.value(key, Json()) : Json();
  return found.is_string()           ? found.get<std::string>()
         : found.is_number_integer() ? found.dump()
                                     : std::string();
}

/// The plane that an image's row and column directions lie in, by the patient's axis nearest to its normal.
std::string plane_of(const Json& series) {
  const Json cosines = series.value("orientation", Json());
  if (!cosines.is_array() || cosines.size() != 6) return {};
  const auto direction = [&](std::size_t first) {
    return Eigen::Vector3d(cosines.at(first).get<double>(), cosines.at(first + 1).get<double>(),
                           cosines.at(first + 2).get<double>());
  };
  Eigen::Index axis = 0;
  direction(0).cross(direction(3)).cwiseAbs().maxCoeff(&axis);
  return std::array<const char*, 3>{"sagittal", "coronal", "axial"}[static_cast<std::size_t>(axis)];
}

std::string size_of(const Series& series) {
  return fmt::format("{0} x {0} x {1} mm", fixed(series.pixel_mm, 2), fixed(series.slice_mm, 2));
}

}  // namespace

std::string Series::in_words() const {
  std::string words = contrast;
  for (const std::string& part :
       {plane, size_of(*this),
        field_strength_T > 0 ? fmt::format("{:g} T", field_strength_T) : std::string()})
    if (!part.empty()) words += (words.empty() ? "" : ", ") + part;
  return words;
}

std::vector<Series> series_of(const CaseData& data) {
  std::vector<Series> result;
  for (const auto& read : data.case_json.value("series", Json::array())) {
    Series series;
    series.stack = text_of(read, "name");
    series.description = text_of(read, "description");
    series.number = text_of(read, "number");
    series.plane = plane_of(read);
    series.pixel_mm = value_of(read, "column_spacing_mm").value_or(0);
    series.slice_mm = value_of(read, "slice_spacing_mm").value_or(0);
    series.field_strength_T = value_of(read, "field_strength_T").value_or(0);
    series.slices = static_cast<int>(value_of(read, "slices").value_or(0));
    for (const auto& stack : data.case_json.value("stacks", Json::array())) {
      if (text_of(stack, "name") != series.stack) continue;
      series.contrast = text_of(stack, "contrast");
      series.is_used = stack.value("used", false);
      series.reason = text_of(stack, "reason");
    }
    if (!series.stack.empty()) result.push_back(series);
  }
  return result;
}

std::vector<Series> used_series(const CaseData& data) {
  std::vector<Series> used = series_of(data);
  used.erase(std::remove_if(used.begin(), used.end(), [](const Series& series) { return !series.is_used; }),
             used.end());
  return used;
}

Table series_table(const CaseData& data) {
  Table table{
      "Images that were read", {"Stack", "Series", "Contrast", "Plane", "Voxel", "Slices", "Use"}, {}};
  for (const auto& series : series_of(data))
    table.rows.push_back({series.stack,
                          series.number + (series.number.empty() || series.description.empty() ? "" : ": ") +
                              series.description,
                          series.contrast, series.plane, size_of(series), std::to_string(series.slices),
                          series.is_used ? "used" : "not used: " + series.reason});
  return table;
}

}  // namespace emmetrope::report
