#pragma once
#include <cmath>
#include <optional>
#include <string>

namespace emmetrope {

/// The finite number that a text is, as people and spreadsheets type it; nothing where more or less stands
/// there. No hexadecimal numbers: nobody types them.
inline std::optional<double> typed_number(const std::string& text) {
  if (text.find_first_of("xX") != std::string::npos) return std::nullopt;
  std::size_t used = 0;
  try {
    const double value = std::stod(text, &used);
    if (used == text.size() && std::isfinite(value)) return value;
  } catch (const std::exception&) {
  }
  return std::nullopt;
}

}  // namespace emmetrope
