#include "segmentation/intake/scanned_series.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "segmentation/intake/file_mention.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {

std::string ScannedFile::name() const {
  if (is_sidecar) return mention(file, "the volume's sidecar");
  const auto instance = parse_number(header.value(tag::instance_number));
  return mention(file, instance ? fmt::format("slice {:g}", *instance) : fmt::format("file {}", number));
}

std::string SeriesImage::name() const {
  const bool multi_frame = source->header.frames.size() > 1;
  return source->name() + (multi_frame ? fmt::format(" frame {}", frame + 1) : "");
}

int ScannedFile::frame_count() const { return std::max(1, static_cast<int>(header.frames.size())); }

std::string found(const ScannedFile& file, const Tag& tag, int frame) {
  const auto& value = file.header.value(tag, frame);
  return fmt::format("{}: {} {}", file.name(), to_string(tag),
                     value.empty() ? "is absent" : "is " + in_quotes(value));
}

std::string found(const SeriesImage& image, const Tag& tag) { return found(*image.source, tag, image.frame); }

std::optional<double> number_of(const ScannedFile& file, const Tag& tag) {
  return parse_number(file.header.value(tag));
}

std::string component_of(const SeriesImage& image) {
  const auto& told = image.value(tag::complex_image_component);
  if (!told.empty() && told != "MIXED") return told;
  for (const Tag& tag : {tag::frame_type, tag::image_type})
    for (const std::string& word : split_values(image.value(tag)))
      if (word == "P" || word == "PHASE") return "PHASE";
  return "MAGNITUDE";
}

}  // namespace emmetrope::segmentation
