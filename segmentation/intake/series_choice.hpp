#pragma once
#include <optional>
#include <string>
#include <vector>

namespace emmetrope::segmentation {

/// One series of a study.
struct SeriesChoice {
  std::string series;  ///< SeriesInstanceUID; where an inventory is at hand also its number in it
  struct TagValue {
    std::string keyword, value;
  };
  /// Of a series with several images at one position, those with this value of a tag; none: all images.
  std::optional<TagValue> images_with;
};

/// \param text  "UID", or "UID,KEYWORD=VALUE" as in "1.2.3,EchoTime=91"
/// \throw Error (usage)
SeriesChoice parse_series_choice(const std::string& text);
std::vector<SeriesChoice> parse_series_choices(const std::vector<std::string>& texts);

/// The text of it.
std::string to_string(const SeriesChoice& choice);

}  // namespace emmetrope::segmentation
