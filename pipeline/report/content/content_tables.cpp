#include "pipeline/report/content/content_tables.hpp"

#include "pipeline/base/notation.hpp"
#include "pipeline/report/content/first_page.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstring>

namespace emmetrope::report {
namespace {

constexpr const char* none = "\u2013";

/// A ratio too small for its decimals keeps two digits.
std::string number_or_ratio(double value, const NumberStyle& style) {
  const bool is_small = style.unit.empty() && value > 0 && value < 0.5 * std::pow(10.0, -style.decimals);
  return is_small ? fmt::format("{:.1e}", value) : format(value, style);
}

}  // namespace

std::string short_name(const EyeData& eye) { return eye.laterality == Laterality::od ? "OD" : "OS"; }

Table eye_table(std::string caption, const Eyes& eyes, Json EyeData::*document,
                const std::vector<EyeRow>& rows) {
  Table table{std::move(caption), {"Quantity"}, {}};
  for (const auto* eye : eyes) table.header.push_back(short_name(*eye));
  for (const auto& row : rows) {
    std::vector<std::string> cells{row.name};
    bool any = false;
    for (const auto* eye : eyes) {
      const bool is_told = row.is_told_of == nullptr || row.is_told_of(*eye);
      const auto value = is_told ? value_at(eye->*document, row.pointer) : std::nullopt;
      any = any || value.has_value();
      cells.push_back(value ? number_or_ratio(*value, row.style) : none);
    }
    if (any) table.rows.push_back(cells);
  }
  return table;
}

std::string with_symbols(std::string text) {
  for (const auto& [ascii, symbol] : {std::pair{"+-", "\u00b1"}, std::pair{" um", " \u00b5m"}})
    for (auto at = text.find(ascii); at != std::string::npos; at = text.find(ascii, at + 1))
      text.replace(at, std::strlen(ascii), symbol);
  return text;
}

PowerTable::PowerTable(std::string caption, std::string first, const Eyes& eyes, NumberStyle style)
    : table_{std::move(caption), {std::move(first)}, {}}, style_(std::move(style)) {
  for (const auto* eye : eyes)
    for (const char* part : {" M", " J0", " J45"}) table_.header.push_back(short_name(*eye) + part);
}

void PowerTable::add(const std::string& name, const std::vector<Json>& powers) {
  std::vector<std::string> row{with_symbols(name)};
  bool any = false;
  for (const auto& power : powers)
    for (const char* key : {"M_D", "J0_D", "J45_D"}) {
      const auto value = value_of(power, key);
      any = any || value.has_value();
      row.push_back(value ? format(*value, style_) : none);
    }
  if (any) table_.rows.push_back(row);
}

std::string refraction_of(const Json& notation, const std::string& otherwise) {
  const auto sphere = value_of(notation, "sphere_D");
  if (!sphere) return otherwise;
  const std::string text = format_refraction(
      {*sphere, value_of(notation, "cylinder_D").value_or(0), value_of(notation, "axis_deg").value_or(180)});
  return has_axis(notation.value("cylinder_D", Json())) ? text : without_axis(text);
}

std::string without_axis(std::string refraction) {
  const std::string before_axis = " x ";
  if (const auto at = refraction.find(before_axis); at != std::string::npos)
    refraction.replace(at + before_axis.size(), std::string::npos, none);
  return refraction;
}

}  // namespace emmetrope::report
