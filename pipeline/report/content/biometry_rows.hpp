#pragma once
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/eye/population/limits.hpp"
#include "pipeline/report/document/numbers.hpp"

namespace emmetrope::report {

/// One line of the biometry table: where the number is in biometry.json and how it is written.
struct BiometryRow {
  std::string key;  ///< path in biometry.json, '/' between levels
  std::string name;
  NumberStyle style;
  const char* cylinder = nullptr;  ///< of an axis: path of the cylinder whose axis it is

  /// Whether a document's number means something: an axis of a cylinder that may be none does not.
  bool is_determined(const Json& document) const;
  /// What is normal at that age (normal_at_age).
  Normal normal(std::optional<double> age_years) const;
  /// Whether a value is, both in the style's decimals: a text "7.5 is outside 7.5 to 13.2" would be none.
  bool is_normal(double value, std::optional<double> age_years) const;
};

/// Of the axial length that tables tell in a note: the optical one stands for both.
inline constexpr const char* inner_axial_length_key = "axial_length_mm";

const std::vector<BiometryRow>& biometry_rows();
const std::vector<BiometryRow>& keratometry_rows();
const std::vector<BiometryRow>& retina_rows();
/// Names of what biometry.json withholds, by reason.
std::map<std::string, std::string> withheld_quantities(const Json& biometry);
/// The three in this order.
std::array<const std::vector<BiometryRow>*, 3> measured_rows();

}  // namespace emmetrope::report
