#include "segmentation/intake/file_mention.hpp"

#include "pipeline/base/clean_text.hpp"

namespace emmetrope::segmentation {
namespace {

// No text from a file holds these: make_clean_utf8 takes control characters out.
constexpr char own_name = '\x01', neutral_name = '\x02', end_of_names = '\x03';

std::string resolve(const std::string& message, char kept) {
  std::string text;
  char part = end_of_names;  // outside of a mention
  for (const char letter : message) {
    if (letter == own_name || letter == neutral_name || letter == end_of_names)
      part = letter;
    else if (part == end_of_names || part == kept)
      text += letter;
  }
  return text;
}

}  // namespace

std::string mention(const std::filesystem::path& file, const std::string& neutral) {
  return own_name + clean_utf8(file.string()) + neutral_name + neutral + end_of_names;
}

std::string with_file_names(const std::string& message) { return resolve(message, own_name); }
std::string without_file_names(const std::string& message) { return resolve(message, neutral_name); }

}  // namespace emmetrope::segmentation
