#pragma once
#include <string>
#include <vector>

#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/document/document.hpp"
#include "pipeline/report/document/numbers.hpp"

/// Tables that several sections have in common: OD first, as clinics write them.
namespace emmetrope::report {

using Eyes = std::vector<const EyeData*>;

/// "OD" or "OS"
std::string short_name(const EyeData& eye);

/// A number that stands somewhere in an eye's document, plain or measured.
struct EyeRow {
  std::string pointer;  ///< JSON pointer, "/plano_cylinder/radius_mm"
  std::string name;
  NumberStyle style;
  bool (*is_told_of)(const EyeData&) = nullptr;  ///< of which eyes; null: of all
};

/// One eye a column. A row that no eye has is left out; where one eye alone lacks it stands a dash.
Table eye_table(std::string caption, const Eyes& eyes, Json EyeData::*document,
                const std::vector<EyeRow>& rows);

/// The document's text for the eyes: ASCII "+-" and "um" become symbols.
std::string with_symbols(std::string text);

/// A table whose rows hold M, J0 and J45 of each eye.
class PowerTable {
 public:
  PowerTable(std::string caption, std::string first, const Eyes& eyes, NumberStyle style);

  /// \param powers  one for each eye; null where there is none. A row without any is left out.
  void add(const std::string& name, const std::vector<Json>& powers);
  const Table& table() const { return table_; }

 private:
  Table table_;
  NumberStyle style_;
};

/// "-2.25 / -1.00 x 180" of what has sphere_D, cylinder_D and axis_deg, without_axis() where the cylinder's interval holds
/// zero; `otherwise` where it has no sphere.
std::string refraction_of(const Json& notation, const std::string& otherwise = "\u2013");

/// A refraction whose cylinder may be none: "-0.75 / -0.50 x \u2013".
std::string without_axis(std::string refraction);

}  // namespace emmetrope::report
