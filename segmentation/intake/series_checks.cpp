#include "segmentation/intake/series_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <regex>

#include "segmentation/intake/plausible.hpp"
#include "segmentation/intake/series_description.hpp"
#include "segmentation/intake/series_warnings.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

/// Largest difference of a direction cosine within a series.
constexpr double same_orientation = 1e-4;
/// Largest error of the norm and of the dot product of the two directions; below it they are made
/// orthonormal.
constexpr double orthonormal = 1e-3;
/// Relative difference of pixel spacings within a series, the rounding of headers.
constexpr double same_spacing = 1e-4;
using Files = std::vector<ScannedFile>;

std::vector<SeriesImage> images_of(const Files& files) {
  std::vector<SeriesImage> images;
  for (const auto& file : files)
    for (int frame = 0; frame < file.frame_count(); ++frame)
      images.push_back({&file, frame, Eigen::Vector3d::Zero(), 1, 0});
  return images;
}

bool is_mosaic(const ImageHeader& header) {
  const auto says = [&](const Tag& tag, const char* word) {
    return header.value(tag).find(word) != std::string::npos;
  };
  return says(tag::image_type, "MOSAIC") ||
         (says(tag::private_creator_0019, "SIEMENS") && header.has(tag::mosaic_images));
}

/// As Siemens and others name it: "*ep2d1_128", "ep_b1000#2", "epfid2d1_64", "EPI".
bool names_echo_planar(const std::string& sequence) {
  static const std::regex name("[*_]?ep([_0-9]|i|fid|se).*", std::regex::icase);
  return std::regex_match(sequence.substr(0, 16), name);
}

/// A file may be classic (one frame), enhanced (no ScanningSequence) or legacy converted (one of each frame).
void check_echo_planar(const ScannedFile& file) {
  for (int frame = 0; frame < file.frame_count(); ++frame) {
    const auto sequence = split_values(file.header.value(tag::scanning_sequence, frame));
    const bool by_sequence = std::find(sequence.begin(), sequence.end(), "EP") != sequence.end();
    const bool by_name = names_echo_planar(file.header.value(tag::sequence_name, frame));
    if (by_sequence || by_name || file.header.value(tag::echo_planar, frame) == "YES")
      throw unsupported_error(
          found(file,
                by_sequence ? tag::scanning_sequence
                : by_name   ? tag::sequence_name
                            : tag::echo_planar,
                frame) +
          ": echo-planar images (diffusion, perfusion, function) are distorted by millimetres near air, where "
          "eyes are");
  }
}

/// Of several weightings at one place that which is not weighted may have been chosen.
void check_diffusion(const std::vector<SeriesImage>& images) {
  for (const SeriesImage& image : images)
    if (parse_number(image.value(tag::diffusion_b_value)).value_or(0) > 0)
      throw unsupported_error(found(image, tag::diffusion_b_value) +
                              ": images weighted by diffusion show no eye in detail");
}

/// What has no slices or no intensities of an acquisition, in the standard's words and the vendors'.
bool is_no_acquisition(const std::string& type) {
  static const std::regex words(
      "(^|[^A-Z0-9])(PROJECTION|T?MIP|T?MINIP|MNIP|M(AX|IN|EAN)[ _]IP|VRT|SSD|(VOLUME|SURFACE)[ _]RENDER(ED|ING)?|"
      "CURVED|MAP|E?ADC|(COL)?FA|TRACEW?|TENSOR|DIFFUSION|(R|REL)?(CB[FV]|MTT)|TTP|SUB(TRACT(ION)?)?)($|[^A-Z0-9])",
      std::regex::icase);
  return std::regex_search(type, words);
}

void check_modality(const ScannedFile& file) {
  if (file.header.value(tag::modality) != "MR")
    throw unsupported_error(found(file, tag::modality) + "; MR is required (--any-modality overrides)");
}

/// A storage class of the standard other than MR's. Vendors' own classes are judged by the modality.
bool is_other_image(const std::string& sop_class) {
  return sop_class.rfind(uid::image_storage, 0) == 0 && sop_class != uid::mr_image &&
         sop_class.rfind(std::string(uid::mr_image) + ".", 0) != 0;
}

void check_kind(const Files& files, bool any_modality) {
  for (const auto& file : files) {
    const auto& header = file.header;
    const auto& sop_class = header.value(tag::sop_class);
    const bool multi_frame_mr =
        sop_class == uid::enhanced_mr_image || sop_class == uid::legacy_converted_enhanced_mr_image;
    if (file.header.kind == FileKind::damaged)
      throw input_error(file.name() + ": " + header.reason, "restore this file or move it away");
    if (!header.has(tag::series_instance))
      throw input_error(found(file, tag::series_instance) + "; its series is unknown");
    if (!any_modality) check_modality(file);
    if (!any_modality && is_other_image(sop_class))
      throw unsupported_error(found(file, tag::sop_class) +
                              ", a secondary capture or another modality's image; an MR image is required "
                              "(--any-modality overrides)");
    if (header.value(tag::burned_in_annotation) == "YES")
      throw input_error(found(file, tag::burned_in_annotation) +
                        ": text drawn into the image would be measured");
    if (header.has(tag::modality_lut))
      throw unsupported_error(file.name() + ": " + to_string(tag::modality_lut) +
                              " gives stored values another meaning; a linear rescale is required");
    check_echo_planar(file);
    if (is_mosaic(header))
      throw unsupported_error(found(file, tag::image_type) +
                              ": a Siemens mosaic shows many slices in one image; export single slices");
    if (!multi_frame_mr && number_of(file, tag::number_of_frames).value_or(1) > 1)
      throw unsupported_error(found(file, tag::number_of_frames) +
                              ", without a position for each frame; enhanced MR is required");
    if (multi_frame_mr &&
        static_cast<double>(header.frames.size()) != number_of(file, tag::number_of_frames).value_or(-1))
      throw input_error(fmt::format("{}, but there are functional groups for {} frames",
                                    found(file, tag::number_of_frames), header.frames.size()));
  }
}

void check_pixel_format(const Files& files) {
  for (const auto& file : files) {
    const auto& header = file.header;
    for (const auto& tag : {tag::rows, tag::columns})
      if (number_of(file, tag) != number_of(files.front(), tag))
        throw input_error(fmt::format("{}, but {}", found(file, tag), found(files.front(), tag)),
                          "a series has one size");
    const auto& photometric = header.value(tag::photometric_interpretation);
    if (photometric == "MONOCHROME1")
      throw unsupported_error(found(file, tag::photometric_interpretation) +
                              ": inverted; MONOCHROME2 is required");
    if (photometric != "MONOCHROME2")
      throw unsupported_error(found(file, tag::photometric_interpretation) + "; MONOCHROME2 is required");
    if (number_of(file, tag::samples_per_pixel) != 1.0)
      throw unsupported_error(found(file, tag::samples_per_pixel) + "; 1 is required");
  }
}

/// A rescale of a frame, (0028,1053) and (0028,1052); 1 and 0 where both are absent.
std::array<double, 2> rescale_of(const ScannedFile& file, int frame) {
  const auto number = [&](const Tag& tag, double absent) -> std::optional<double> {
    return file.header.has(tag, frame) ? parse_number(file.header.value(tag, frame)) : absent;
  };
  const auto slope = number(tag::rescale_slope, 1), intercept = number(tag::rescale_intercept, 0);
  if (!slope || !is_plausible_slope(*slope))
    throw input_error(fmt::format("{}; a number from {:g} to {:g} is required",
                                  found(file, tag::rescale_slope, frame), least_slope, largest_slope));
  if (!intercept || !is_plausible_intercept(*intercept, *slope))
    throw input_error(fmt::format("{}; a number of at most {:g} times the slope is required",
                                  found(file, tag::rescale_intercept, frame), largest_intercept));
  return {*slope, *intercept};
}

std::array<double, 2> pixel_spacing_of(const ScannedFile& file, int frame) {
  const auto spacing = parse_numbers(file.header.value(tag::pixel_spacing, frame), 2);
  if (!spacing || !is_plausible_spacing((*spacing)[0]) || !is_plausible_spacing((*spacing)[1]))
    throw input_error(fmt::format("{}; two numbers from {:g} to {:g} mm are required",
                                  found(file, tag::pixel_spacing, frame), least_spacing_mm,
                                  largest_spacing_mm));
  return {(*spacing)[0], (*spacing)[1]};
}

std::array<double, 6> orientation_of(const ScannedFile& file, int frame) {
  const auto cosines = parse_numbers(file.header.value(tag::image_orientation, frame), 6);
  if (!cosines) throw input_error(found(file, tag::image_orientation, frame) + "; six numbers are required");
  const Eigen::Vector3d row(cosines->data()), column(cosines->data() + 3);
  if (std::abs(row.norm() - 1) > orthonormal || std::abs(column.norm() - 1) > orthonormal ||
      std::abs(row.dot(column)) > orthonormal)
    throw input_error(found(file, tag::image_orientation, frame) +
                      "; two unit vectors at a right angle are required");
  std::array<double, 6> values{};
  std::copy(cosines->begin(), cosines->end(), values.begin());
  return values;
}

std::array<double, 6> made_orthonormal(const std::array<double, 6>& cosines) {
  const Eigen::Vector3d row = Eigen::Vector3d(cosines.data()).normalized();
  Eigen::Vector3d column(cosines.data() + 3);
  column = (column - row * row.dot(column)).normalized();
  return {row.x(), row.y(), row.z(), column.x(), column.y(), column.z()};
}

void check_one_study(const Files& files) {
  for (const auto& file : files)
    for (const Tag& tag : {tag::study_instance, tag::frame_of_reference})
      if (file.header.value(tag) != files.front().header.value(tag))
        throw input_error(fmt::format("{} and {}: different {} in one series", files.front().name(),
                                      file.name(), to_string(tag)));
}

/// Reads where each image lies and how it is scaled, and judges it against the first.
void place_images(std::vector<SeriesImage>& images, SeriesInfo& info) {
  const SeriesImage& first = images.front();
  const auto spacing = pixel_spacing_of(*first.source, first.frame);
  const auto orientation = orientation_of(*first.source, first.frame);
  info.row_spacing_mm = spacing[0];
  info.column_spacing_mm = spacing[1];
  info.orientation = made_orthonormal(orientation);
  for (SeriesImage& image : images) {
    const auto its_spacing = pixel_spacing_of(*image.source, image.frame);
    for (std::size_t i = 0; i < 2; ++i)
      if (std::abs(its_spacing[i] - spacing[i]) > same_spacing * spacing[i])
        throw input_error(
            fmt::format("{}, but {}", found(image, tag::pixel_spacing), found(first, tag::pixel_spacing)));
    const auto its_orientation = orientation_of(*image.source, image.frame);
    for (std::size_t i = 0; i < 6; ++i)
      if (std::abs(its_orientation[i] - orientation[i]) > same_orientation)
        throw input_error(
            fmt::format("{}, but {}: the slices are not parallel", found(image, tag::image_orientation),
                        found(first, tag::image_orientation)),
            image.value(tag::stack_id) == first.value(tag::stack_id)
                ? ""
                : fmt::format("choose one stack with --series '{},{}={}'", info.uid, tag::stack_id.keyword,
                              first.value(tag::stack_id)));
    const auto position = parse_numbers(image.value(tag::image_position), 3);
    if (!position) throw input_error(found(image, tag::image_position) + "; three numbers are required");
    const auto [slope, intercept] = rescale_of(*image.source, image.frame);
    image.position_mm = Eigen::Vector3d(position->data());
    image.slope = slope;
    image.intercept = intercept;
  }
}

void check_component(const std::vector<SeriesImage>& images, const std::string& uid) {
  const SeriesImage& first = images.front();
  for (const SeriesImage& image : images) {
    if (component_of(image) == component_of(first)) continue;
    for (const Tag& tag : {tag::complex_image_component, tag::frame_type, tag::image_type})
      if (const auto& one = first.value(tag), &other = image.value(tag); one != other)
        throw input_error(fmt::format("{} and {}: {} is {} and {}: {} and {} make no stack", first.name(),
                                      image.name(), to_string(tag), in_quotes(one), in_quotes(other),
                                      component_of(first), component_of(image)),
                          fmt::format("choose the images of one with --series '{},{}={}'", uid, tag.keyword,
                                      one.empty() ? other : one));
  }
}

/// Slices of one stack are of one contrast: times agree but for the rounding and jitter of scanners.
void check_contrast(const std::vector<SeriesImage>& images, const std::string& uid) {
  constexpr double same_time = 0.05;
  for (const Tag& tag : {tag::echo_time, tag::effective_echo_time, tag::repetition_time, tag::inversion_time,
                         tag::inversion_times}) {
    const SeriesImage& first = images.front();
    const auto time = parse_number(first.value(tag));
    if (!time) continue;
    for (const SeriesImage& image : images) {
      const auto its = parse_number(image.value(tag));
      if (!its || std::abs(*its - *time) <= same_time * std::abs(*time)) continue;
      throw input_error(
          fmt::format("{} and {}: {} is {:g} and {:g}: slices of two contrasts make no stack", first.name(),
                      image.name(), to_string(tag), *time, *its),
          fmt::format("choose the images of one with --series '{},{}={:g}'", uid, tag.keyword, *time));
    }
  }
}

void check_pixels(const Files& files) {
  for (const auto& file : files)
    if (!file.end.error.empty()) {
      const std::string text = file.name() + ": " + file.end.error;
      throw file.end.unsupported ? unsupported_error(text) : input_error(text);
    }
}

void check_total_size(const SeriesInfo& info, std::size_t images, std::uint64_t limit) {
  const auto bytes = static_cast<std::uint64_t>(info.rows) * static_cast<std::uint64_t>(info.columns) *
                     images * sizeof(float);
  if (bytes > 2 * limit)  // stored with 16 bits, read with 32
    throw input_error(fmt::format("{} rows x {} columns x {} slices are more than {} MB", info.rows,
                                  info.columns, images, limit / 1'000'000));
}

void check_acquired(const std::vector<SeriesImage>& images) {
  for (const SeriesImage& image : images)
    for (const Tag& tag : {tag::image_type, tag::frame_type, tag::volume_calculation})
      if (is_no_acquisition(image.value(tag)))
        throw unsupported_error(
            found(image, tag) + ": a projection, a map, a difference or diffusion, not slices as acquired",
            "use the series that it was made from");
}

/// Keeps the images that the user chose for this series.
void apply_choice(const std::vector<SeriesChoice>& choices, const SeriesInfo& info,
                  std::vector<SeriesImage>& images) {
  for (const SeriesChoice& choice : choices) {
    if (choice.series != info.uid || !choice.images_with) continue;
    const auto& [keyword, value] = *choice.images_with;
    const auto matches = [&, &keyword = keyword, &value = value](const SeriesImage& image) {
      const auto& its = image.value(Tag{0, 0, keyword.c_str()});
      const auto number = parse_number(value);
      return its == value || (number && parse_number(its) == number);
    };
    images.erase(
        std::remove_if(images.begin(), images.end(), [&](const auto& image) { return !matches(image); }),
        images.end());
    if (images.empty())
      throw input_error("--series " + in_quotes(to_string(choice)) +
                        ": no image of the series has this value");
  }
}

}  // namespace

void judge_sidecar(const ScannedFile& sidecar, const IntakeOptions& options, SeriesInfo& info) {
  const std::optional<double> spacing_mm = info.slice_thickness_mm;
  const std::vector<SeriesImage> images{{&sidecar, 0, Eigen::Vector3d::Zero(), 1, 0}};
  describe_images(images, info);
  if (!info.slice_thickness_mm) info.slice_thickness_mm = spacing_mm;
  warn_of_sparse_slices(info);
  if (!options.any_modality && sidecar.header.has(tag::modality)) check_modality(sidecar);
  check_echo_planar(sidecar);
  check_acquired(images);
  // Its text may name a person, whom a sidecar does not tell.
  if (!shows_head(sidecar.header.value(tag::body_part)))
    info.warnings.push_back(sidecar.name() + ": " + to_string(tag::body_part) + " is not the head");
  warn_of_image_type(images, info);
}

SeriesInfo judge_series(std::vector<ScannedFile> files, const IntakeOptions& options) {
  // Names and order of files must not matter.
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) {
    return std::tie(a.header.value(tag::sop_instance), a.file) <
           std::tie(b.header.value(tag::sop_instance), b.file);
  });
  SeriesInfo info;
  describe_series(files, info);
  auto images = images_of(files);
  describe_images(images, info);
  info.damaged = std::any_of(files.begin(), files.end(), [](const auto& file) {
    return file.header.kind == FileKind::damaged || (!file.end.error.empty() && !file.end.unsupported);
  });
  try {
    check_kind(files, options.any_modality);
    check_pixel_format(files);
    check_one_study(files);
    apply_choice(options.choices, info, images);
    describe_images(images, info);
    place_images(images, info);
    check_acquired(images);
    check_pixels(files);
    check_total_size(info, images.size(), options.limits.series_bytes);
    add_statistics(images, info);
    add_warnings(files, images, info);
    judge_positions(images, info);
    check_contrast(images, info.uid);
    check_component(images, info.uid);
    check_diffusion(images);
    info.usable = true;
  } catch (const Error& refusal) {
    if (refusal.status() == ExitStatus::usage) throw;
    info.reason = refusal.what() + (refusal.remedy().empty() ? "" : "; " + refusal.remedy());
    info.refusal = refusal.status();
  }
  return info;
}

}  // namespace emmetrope::segmentation
