#include "segmentation/intake/tag_values.hpp"

#include <charconv>
#include <cmath>

namespace emmetrope::segmentation {
namespace {

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

}  // namespace

std::vector<std::string> split_values(std::string_view text) {
  std::vector<std::string> parts;
  while (!text.empty()) {
    const auto end = std::min(text.find('\\'), text.size());
    parts.emplace_back(trimmed(text.substr(0, end)));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return parts;
}

std::optional<double> parse_number(std::string_view text) {
  text = trimmed(text);
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec != std::errc() || result.ptr != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

std::optional<std::vector<double>> parse_numbers(std::string_view text, std::size_t count) {
  std::vector<double> values;
  for (const auto& part : split_values(text)) {
    const auto value = parse_number(part);
    if (!value) return {};
    values.push_back(*value);
  }
  if (values.size() != count) return {};
  return values;
}

std::string in_quotes(std::string_view text) {
  std::string clean(text.substr(0, 80));
  for (char& letter : clean)
    if (static_cast<unsigned char>(letter) < 0x20) letter = '?';
  return "\"" + clean + (text.size() > 80 ? "..." : "") + "\"";
}

}  // namespace emmetrope::segmentation
