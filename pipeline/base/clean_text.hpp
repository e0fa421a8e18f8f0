#pragma once
#include <string>

namespace emmetrope {

/// Text from a file, fit to be shown and written: valid UTF-8 (U+FFFD for what is none) without control and
/// format characters, which could steer a terminal or turn the direction of what stands beside them (U+202E); those that end a line
/// or a word are spaces.
/// \return whether the text was valid UTF-8
bool make_clean_utf8(std::string& text);

/// The same of a copy.
std::string clean_utf8(std::string text);

}  // namespace emmetrope
