#include "segmentation/intake/series_choice.hpp"

#include <algorithm>
#include <iterator>

#include "pipeline/base/error.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {

SeriesChoice parse_series_choice(const std::string& text) {
  const auto comma = text.find(',');
  if (comma == std::string::npos) return {text, std::nullopt};
  const auto equals = text.find('=', comma);
  if (equals == std::string::npos || equals == comma + 1)
    throw usage_error("--series " + in_quotes(text) + " is not UID,KEYWORD=VALUE");
  return {text.substr(0, comma),
          SeriesChoice::TagValue{text.substr(comma + 1, equals - comma - 1), text.substr(equals + 1)}};
}

std::vector<SeriesChoice> parse_series_choices(const std::vector<std::string>& texts) {
  std::vector<SeriesChoice> choices;
  std::transform(texts.begin(), texts.end(), std::back_inserter(choices), parse_series_choice);
  return choices;
}

std::string to_string(const SeriesChoice& choice) {
  if (!choice.images_with) return choice.series;
  return choice.series + "," + choice.images_with->keyword + "=" + choice.images_with->value;
}

}  // namespace emmetrope::segmentation
