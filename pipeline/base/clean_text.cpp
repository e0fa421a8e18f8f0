#include "pipeline/base/clean_text.hpp"

#include <glib.h>

namespace emmetrope {
namespace {

bool ends_a_word(gunichar letter) {
  const GUnicodeType type = g_unichar_type(letter);
  return (letter >= '\t' && letter <= '\r') || type == G_UNICODE_LINE_SEPARATOR ||
         type == G_UNICODE_PARAGRAPH_SEPARATOR;
}

bool is_shown(gunichar letter) {
  const GUnicodeType type = g_unichar_type(letter);
  return type != G_UNICODE_CONTROL && type != G_UNICODE_FORMAT;
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
    if (ends_a_word(letter))
      clean += ' ';
    else if (is_shown(letter))
      clean.append(text, at, length);
    at += length;
  }
  text = std::move(clean);
  return valid;
}

std::string clean_utf8(std::string text) {
  make_clean_utf8(text);
  return text;
}

}  // namespace emmetrope
