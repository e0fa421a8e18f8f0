#include "pipeline/report/document/numbers.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "pipeline/base/notation.hpp"

namespace emmetrope::report {

std::string fixed(double value, int decimals) {
  return fmt::format("{:.{}f}", without_negative_zero(value, decimals), decimals);
}

std::string signed_fixed(double value, int decimals) {
  const std::string text = fixed(value, decimals);
  const bool is_positive = text[0] != '-' && text.find_first_not_of("0.") != std::string::npos;
  return is_positive ? "+" + text : text;
}

std::string format(double value, const NumberStyle& style) {
  if (!std::isfinite(value)) return "not determined";
  std::string number = style.with_sign ? signed_fixed(value, style.decimals) : fixed(value, style.decimals);
  if (style.unit == "axis") return (std::stod(number) == 0 ? fixed(180, style.decimals) : number) + "\u00b0";
  if (style.unit.empty()) return number;
  return style.unit == "deg" ? number + "\u00b0" : number + " " + style.unit;
}

std::string format_interval(const Measured& measured, const NumberStyle& style) {
  if (style.unit == "deg" || style.unit == "axis") {  // an axis turns on at 180
    const double half_width = (measured.ci95[1] - measured.ci95[0]) / 2;
    return half_width >= 90 ? "any" : "\u00b1 " + fixed(half_width, style.decimals) + "\u00b0";
  }
  const NumberStyle bare{style.decimals, style.with_sign, ""};
  return format(measured.ci95[0], bare) + " to " + format(measured.ci95[1], bare);
}

std::string age_text(double age_years) {
  return age_years < 2 ? fixed(std::floor(12 * age_years), 0) + " months"
                       : fixed(std::floor(age_years), 0) + " years";
}

std::string format_range(const Range& range, int decimals) {
  if (!std::isfinite(range.low)) return "up to " + fixed(range.high, decimals);
  if (!std::isfinite(range.high)) return "from " + fixed(range.low, decimals);
  return fixed(range.low, decimals) + " to " + fixed(range.high, decimals);
}

std::string source_name(const std::string& source) {
  static const std::map<std::string, std::string> names{{"mri", "MRI"},
                                                        {"labels", "labels by hand"},
                                                        {"topography", "corneal topography"},
                                                        {"axial_length", "optical biometry"},
                                                        {"biometry", "optical biometry"},
                                                        {"refraction", "known refraction"}};
  const std::size_t plus = source.find('+');
  const std::string first = source.substr(0, plus);
  const auto found = names.find(first);
  const std::string name = found == names.end() ? first : found->second;
  return plus == std::string::npos ? name : name + " and " + source_name(source.substr(plus + 1));
}

}  // namespace emmetrope::report
