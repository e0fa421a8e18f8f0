#include "segmentation/intake/clean_text.hpp"

#include <glib.h>

namespace emmetrope::segmentation {
namespace {

bool is_shown(gunichar letter) {
  switch (g_unichar_type(letter)) {
    case G_UNICODE_CONTROL:
    case G_UNICODE_FORMAT:
    case G_UNICODE_LINE_SEPARATOR:
    case G_UNICODE_PARAGRAPH_SEPARATOR:
      return false;
    default:
      return true;
  }
}

}  // namespace

bool make_clean_utf8(std::string& text) {
  constexpr gunichar incomplete = static_cast<gunichar>(-2);  // the largest values are no letters
  std::string clean;
  bool valid = true;
  for (std::size_t at = 0; at < text.size();) {
    const char* here = text.data() + at;
    // A NUL would end the text for the library.
    const gunichar letter =
        *here == '\0' ? 0 : g_utf8_get_char_validated(here, static_cast<gssize>(text.size() - at));
    if (letter >= incomplete) {
      clean += "\xEF\xBF\xBD";
      valid = false;
      ++at;
      continue;
    }
    const auto length = static_cast<std::size_t>(g_unichar_to_utf8(letter, nullptr));
    if (is_shown(letter)) clean.append(text, at, length);
    at += length;
  }
  text = std::move(clean);
  return valid;
}

std::string clean_utf8(std::string text) {
  make_clean_utf8(text);
  return text;
}

}  // namespace emmetrope::segmentation
