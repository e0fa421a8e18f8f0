#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Reading numbers from the text of DICOM values; never the locale's decimal sign.
namespace emmetrope::segmentation {

/// The parts between backslashes, without blanks around them.
std::vector<std::string> split_values(std::string_view text);

/// A finite number that takes the whole text, or nothing.
std::optional<double> parse_number(std::string_view text);
/// Exactly `count` finite numbers, or nothing.
std::optional<std::vector<double>> parse_numbers(std::string_view text, std::size_t count);

/// Text of a header for a message: control characters replaced, shortened.
std::string in_quotes(std::string_view text);

}  // namespace emmetrope::segmentation
