#pragma once
#include <string>

#include "pipeline/base/json.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/population/limits.hpp"

/// Numbers as the report writes them: one place, so that HTML, PDF and every table agree. ASCII signs,
/// decimal point, whatever the locale.
namespace emmetrope::report {

/// "-2.25", "0.00" (never "-0.00")
std::string fixed(double value, int decimals);
/// "+1.25", "-2.25", "0.00"
std::string signed_fixed(double value, int decimals);

/// How a quantity is written.
struct NumberStyle {
  int decimals = 2;
  bool with_sign = false;
  std::string
      unit;  ///< after the number, with a space before it; "deg" becomes the degree sign without one, and "axis",
             ///< of a cylinder, where 180 stands for 0
};

std::string format(double value, const NumberStyle& style);
/// "23.55 to 23.67", no unit; of an angle "+- 6 deg", or "any" when nothing is known of it
std::string format_interval(const Measured& measured, const NumberStyle& style);

/// Completed years, and months below two years: "8 years", "15 months"
std::string age_text(double age_years);

/// "22.1 to 26.0", "up to 40", "from 2"
/// \pre the range is limited
std::string format_range(const Range& range, int decimals);

/// "mri" -> "MRI", "prior" -> "population prior", ...: sources in the reader's words; unknown ones as they
/// are.
std::string source_name(const std::string& source);

}  // namespace emmetrope::report
