#include "segmentation/intake/series_description.hpp"

#include <algorithm>
#include <limits>
#include <set>

#include "segmentation/intake/plausible.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

/// The eye that the tags name; "B" where some images are of the one and some of the other.
std::string laterality_of(const std::vector<SeriesImage>& images) {
  std::set<std::string> sides;
  for (const auto& image : images)
    for (const Tag& tag : {tag::frame_laterality, tag::image_laterality, tag::series_laterality})
      if (const auto& side = image.value(tag); !side.empty()) {
        sides.insert(side);
        break;
      }
  return sides.empty() ? "" : sides.size() == 1 ? *sides.begin() : "B";
}

/// Enhanced MR says COLUMN where classic images say COL, and OTHER where it is neither.
std::string phase_encoding_of(const std::string& told) {
  return told == "COLUMN"                                                 ? "COL"
         : told == "ROW" || told == "COL" || told == both_phase_encodings ? told
                                                                          : "";
}

}  // namespace

void describe_series(const std::vector<ScannedFile>& files, SeriesInfo& info) {
  const ScannedFile& first = files.front();
  const auto text = [&](const Tag& tag) { return first.header.value(tag); };
  info.uid = text(tag::series_instance);
  info.study_uid = text(tag::study_instance);
  info.frame_of_reference_uid = text(tag::frame_of_reference);
  info.description = first.header.description;
  info.modality = text(tag::modality);
  info.number = static_cast<int>(std::clamp(number_of(first, tag::series_number).value_or(0), -1e9, 1e9));
  info.files = files.size();
  info.rows = static_cast<int>(number_of(first, tag::rows).value_or(0));
  info.columns = static_cast<int>(number_of(first, tag::columns).value_or(0));
  info.body_part = text(tag::body_part);
  const auto slope = number_of(first, tag::philips_scale_slope),
             intercept = number_of(first, tag::philips_scale_intercept);
  if (slope && intercept &&
      first.header.value(tag::private_creator_2005).find("Philips") != std::string::npos)
    info.private_scaling = {*slope, *intercept};
  std::set<std::string> syntaxes;
  for (const auto& file : files) syntaxes.insert(file.header.transfer_syntax);
  for (const auto& syntax : syntaxes)
    info.transfer_syntax += (info.transfer_syntax.empty() ? "" : ", ") + syntax;
}

void describe_images(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  const SeriesImage& first = images.front();
  const auto number = [&](const Tag& tag) { return parse_number(first.value(tag)); };
  info.image_type = first.value(tag::image_type);
  info.acquisition_type = first.value(tag::acquisition_type);
  info.sequence = first.value(tag::scanning_sequence);
  info.image_laterality = laterality_of(images);
  info.repetition_time_ms = number(tag::repetition_time);
  info.echo_time_ms = number(tag::echo_time);
  if (!info.echo_time_ms) info.echo_time_ms = number(tag::effective_echo_time);
  info.inversion_time_ms = number(tag::inversion_time);
  if (!info.inversion_time_ms) info.inversion_time_ms = number(tag::inversion_times);
  info.flip_angle_deg = number(tag::flip_angle);
  info.field_strength_T = number(tag::field_strength);
  if (info.field_strength_T && !is_plausible_field(*info.field_strength_T)) info.field_strength_T.reset();
  info.pixel_bandwidth_Hz = number(tag::pixel_bandwidth);
  if (info.pixel_bandwidth_Hz && !is_plausible_bandwidth(*info.pixel_bandwidth_Hz))
    info.pixel_bandwidth_Hz.reset();
  info.phase_encoding = phase_encoding_of(first.value(tag::phase_encoding));
  info.slice_thickness_mm = number(tag::slice_thickness);
  if (info.slice_thickness_mm && !is_plausible_spacing(*info.slice_thickness_mm))
    info.slice_thickness_mm.reset();
}

void add_statistics(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest, sum = 0, count = 0;
  for (const auto& image : images) {
    const auto& stored = image.source->frames.at(static_cast<std::size_t>(image.frame));
    const double a = image.slope * stored.minimum + image.intercept,
                 b = image.slope * stored.maximum + image.intercept;
    lowest = std::min({lowest, a, b});
    highest = std::max({highest, a, b});
    sum +=
        image.slope * static_cast<double>(stored.sum) + image.intercept * static_cast<double>(stored.count);
    count += static_cast<double>(stored.count);
  }
  info.minimum = lowest;
  info.maximum = highest;
  info.mean = sum / count;
}

}  // namespace emmetrope::segmentation
