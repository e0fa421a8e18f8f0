#include "segmentation/intake/series_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/algorithm/string/predicate.hpp>
#include <cmath>
#include <map>
#include <regex>
#include <set>

#include "segmentation/intake/plausible.hpp"
#include "segmentation/intake/subject.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::segmentation {
namespace {

/// Relative difference of row and column spacing from which pixels are not square.
constexpr double square_pixels = 0.01;
/// Relative difference of the field of view that two attributes tell.
constexpr double same_field = 0.05;

/// One warning for all files that share a fault.
template <typename Fault>
void warn_of_files(const std::vector<ScannedFile>& files, const Fault& has_fault, const std::string& text,
                   SeriesInfo& info) {
  std::string first;
  std::size_t count = 0;
  for (const auto& file : files)
    if (has_fault(file) && ++count == 1) first = file.name();
  if (count > 0)
    info.warnings.push_back(
        fmt::format("{}{}: {}", first, count > 1 ? fmt::format(" and {} more", count - 1) : "", text));
}

/// Derived, save by what scanners do to every image at once: distortions and the coils' sensitivities evened out.
bool is_computed(const SeriesImage& image) {
  static const std::vector<std::string> derived{"DERIVED", "PRIMARY", "M"};
  static const std::set<std::string> at_once{"NONE", "ND", "NORM", "DIS2D", "DIS3D", "MFSPLIT"};
  const auto& of_frame = image.value(tag::frame_type);
  const auto type = split_values(of_frame.empty() ? image.value(tag::image_type) : of_frame);
  if (type.empty() || type[0].rfind("DERIVED", 0) != 0) return false;
  const std::size_t first = derived.size();
  return type.size() < first || !std::equal(derived.begin(), derived.end(), type.begin()) ||
         !std::all_of(type.begin() + static_cast<std::ptrdiff_t>(first), type.end(),
                      [&](const std::string& word) { return at_once.count(word) > 0; });
}

void warn_of_computed(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  const auto computed = std::count_if(images.begin(), images.end(), is_computed);
  if (computed == 0) return;
  info.computed = computed == static_cast<std::ptrdiff_t>(images.size());
  const SeriesImage& first = *std::find_if(images.begin(), images.end(), is_computed);
  const Tag& tag = first.value(tag::frame_type).empty() ? tag::image_type : tag::frame_type;
  info.warnings.push_back(fmt::format(
      "{}{}: computed from other images; smoother than the header tells where those were resampled or averaged",
      found(first, tag), computed > 1 ? fmt::format(" and of {} more", computed - 1) : ""));
}

/// By a word of ImageType or FrameType.
DixonPart dixon_part_of(const SeriesImage& image) {
  static const std::map<std::string, DixonPart> parts{{"W", DixonPart::water},
                                                      {"WATER", DixonPart::water},
                                                      {"F", DixonPart::fat},
                                                      {"FAT", DixonPart::fat},
                                                      {"IP", DixonPart::in_phase},
                                                      {"IN_PHASE", DixonPart::in_phase},
                                                      {"OP", DixonPart::opposed_phase},
                                                      {"OPP_PHASE", DixonPart::opposed_phase},
                                                      {"OUT_PHASE", DixonPart::opposed_phase}};
  for (const Tag& tag : {tag::frame_type, tag::image_type})
    for (const std::string& word : split_values(image.value(tag)))
      if (const auto part = parts.find(word); part != parts.end()) return part->second;
  return DixonPart::all;
}

void warn_of_dixon_part(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  const DixonPart part = dixon_part_of(images.front());
  const bool is_one = std::all_of(images.begin(), images.end(),
                                  [&](const SeriesImage& image) { return dixon_part_of(image) == part; });
  if (!is_one) return;
  info.dixon_part = part;
  if (const std::string why = why_unfit(part); !why.empty()) info.warnings.push_back(why + used_on_demand);
}

/// A scanner's pixels are square and fill its field of view: what contradicts this may be a header that was changed.
void warn_of_lengths(const SeriesImage& first, SeriesInfo& info) {
  const double row_mm = *info.row_spacing_mm, column_mm = *info.column_spacing_mm;
  if (std::abs(row_mm / column_mm - 1) > square_pixels)
    info.warnings.push_back(fmt::format(
        "{} is {:g} and {:g} mm, pixels that are not square: where one is wrong, lengths along that axis are wrong by up to {:.0f} %",
        to_string(tag::pixel_spacing), row_mm, column_mm,
        100 * (std::max(row_mm, column_mm) / std::min(row_mm, column_mm) - 1)));
  const double field_mm = std::max(info.rows * row_mm, info.columns * column_mm);
  const double diameter_mm = parse_number(first.value(tag::reconstruction_diameter)).value_or(0);
  if (diameter_mm > 0 && std::abs(field_mm / diameter_mm - 1) > same_field)
    info.warnings.push_back(fmt::format(
        "{} is {:g} mm, but {} makes the field {:g} mm: the images were cropped, or all lengths are wrong by {:.0f} %",
        to_string(tag::reconstruction_diameter), diameter_mm, to_string(tag::pixel_spacing), field_mm,
        100 * std::abs(field_mm / diameter_mm - 1)));
}

/// Whether PatientOrientation, letters of where rows and columns run to, says the opposite of the cosines.
bool is_contradicted(const ImageHeader& header) {
  static const std::map<char, Eigen::Vector3d> directions{{'L', {1, 0, 0}}, {'R', {-1, 0, 0}},
                                                          {'P', {0, 1, 0}}, {'A', {0, -1, 0}},
                                                          {'H', {0, 0, 1}}, {'F', {0, 0, -1}}};
  const auto letters = split_values(header.value(tag::patient_orientation));
  const auto cosines = parse_numbers(header.value(tag::image_orientation), 6);
  if (!cosines || letters.size() != 2) return false;
  for (std::size_t i = 0; i < 2; ++i)
    if (const auto told = directions.find(letters[i].empty() ? ' ' : letters[i][0]);
        told != directions.end() && told->second.dot(Eigen::Vector3d(cosines->data() + 3 * i)) < 0)
      return true;
  return false;
}

void warn_of_times(SeriesInfo& info) {
  const double echo_ms = info.echo_time_ms.value_or(0), repetition_ms = info.repetition_time_ms.value_or(0);
  if (repetition_ms > 0 && echo_ms > repetition_ms)
    info.warnings.push_back(fmt::format("{} is {:g} ms, longer than {}, {:g} ms: one of the two may be wrong",
                                        to_string(tag::echo_time), echo_ms, to_string(tag::repetition_time),
                                        repetition_ms));
}

/// As it is typed: "Homo sapiens (organism)", "HUMAN". No regular expression, as a hostile text may be of any length.
bool is_persons(const std::string& species) {
  constexpr std::array words{"human", "homo", "person", "patient"};
  return species.empty() || std::any_of(words.begin(), words.end(), [&](const char* word) {
           return boost::algorithm::icontains(species, word);
         });
}

void warn_of_phase(const SeriesImage& first, SeriesInfo& info) {
  if (component_of(first) == "PHASE")
    info.warnings.push_back(to_string(tag::image_type) + " says that these are phase images, not magnitudes");
}

const FrameStatistics& stored_of(const SeriesImage& image) {
  return image.source->frames.at(static_cast<std::size_t>(image.frame));
}

void warn_of_lost_slices(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  const auto shows_something = [&](const SeriesImage& image) {
    return stored_of(image).minimum != stored_of(image).maximum;
  };
  // Beyond the head scanners' images may be empty.
  const auto first = std::find_if(images.begin(), images.end(), shows_something);
  const auto last = std::find_if(images.rbegin(), images.rend(), shows_something).base();
  std::map<std::size_t, const SeriesImage*> seen;
  std::vector<std::string> constant, copies;
  for (auto image = first; image < last; ++image) {
    const auto [other, is_new] = seen.try_emplace(stored_of(*image).hash, &*image);
    if (!shows_something(*image))
      constant.push_back(image->name());
    else if (!is_new)
      copies.push_back(other->second->name() + " and " + image->name());
  }
  const auto warn = [&](const std::vector<std::string>& slices, const char* text) {
    if (slices.empty()) return;
    const std::string more = slices.size() > 1 ? fmt::format(", and {} more", slices.size() - 1) : "";
    info.warnings.push_back(
        fmt::format("{}{}: {}; give the study as the scanner sent it", slices.front(), more, text));
  };
  warn(constant,
       "one value throughout between slices that show something, an image that was lost or blanked");
  warn(copies, "the same pixels at two places, one of them not its own");
}

double mean_of(const SeriesImage& image) {
  const FrameStatistics& stored = stored_of(image);
  return image.slope * static_cast<double>(stored.sum) / static_cast<double>(stored.count) + image.intercept;
}

/// Whether its scale sets a slice off from another, for which the stored values do not make up.
bool outshines(const SeriesImage& image, const SeriesImage& other) {
  constexpr double largest_usual_ratio = 1.5;
  return image.slope > other.slope && mean_of(other) > 0 &&
         mean_of(image) > largest_usual_ratio * mean_of(other);
}

/// A scale of each slice is Philips' way; that some lack one, or are brighter by it than both neighbours, is a header that
/// was changed.
void warn_of_scales(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  const auto has_scale = [](const SeriesImage& image) { return !image.value(tag::rescale_slope).empty(); };
  const auto is_scaled = [](const SeriesImage& image) { return image.slope != 1 || image.intercept != 0; };
  const auto with = std::find_if(images.begin(), images.end(), is_scaled);
  const auto without = std::find_if_not(images.begin(), images.end(), has_scale);
  if (with != images.end() && without != images.end())
    info.warnings.push_back(fmt::format("{}, but {}: their grey values may not be comparable",
                                        found(*with, tag::rescale_slope),
                                        found(*without, tag::rescale_slope)));
  for (std::size_t i = 1; i + 1 < images.size(); ++i) {
    const SeriesImage &before = images[i - 1], &here = images[i], &after = images[i + 1];
    const bool is_brighter = outshines(here, before) && outshines(here, after);
    if (!is_brighter && !(outshines(before, here) && outshines(after, here))) continue;
    info.warnings.push_back(
        fmt::format("{}, and the slice is {} than both its neighbours; the scale may be wrong",
                    found(here, tag::rescale_slope), is_brighter ? "brighter" : "darker"));
    break;
  }
}

}  // namespace

std::string why_unfit(DixonPart part) {
  switch (part) {
    case DixonPart::fat:
      return to_string(tag::image_type) + " says that it shows fat alone, in which no eye is seen";
    case DixonPart::opposed_phase:
      return to_string(tag::image_type) +
             " says that water and fat are opposed in phase, so that their borders are black";
    default:
      return {};
  }
}

bool shows_head(const std::string& body_part) {
  static const std::regex head("HEAD|BRAIN|(^|[^A-Z])(ORBIT|EYE|FACE(?!T)|SKULL)", std::regex::icase);
  return body_part.empty() || std::regex_search(body_part, head);
}

void warn_of_image_type(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  warn_of_phase(images.front(), info);
  warn_of_computed(images, info);
  warn_of_dixon_part(images, info);
}

void warn_of_sparse_slices(SeriesInfo& info) {
  constexpr double largest_usual_ratio = 2, largest_usual_overlap = 5;
  if (!info.slice_thickness_mm || !info.slice_spacing_mm) return;
  const double thickness_mm = *info.slice_thickness_mm, spacing_mm = *info.slice_spacing_mm;
  if (spacing_mm > largest_usual_ratio * thickness_mm)
    info.warnings.push_back(
        fmt::format("slices {:.3g} mm thick lie {:.3g} mm apart: what is between them is in no image",
                    thickness_mm, spacing_mm));
  if (thickness_mm > largest_usual_overlap * spacing_mm)
    info.warnings.push_back(fmt::format("slices {:.3g} mm thick lie {:.3g} mm apart: {} may be wrong",
                                        thickness_mm, spacing_mm, to_string(tag::slice_thickness)));
}

void warn_of_slices(const std::vector<SeriesImage>& images, SeriesInfo& info) {
  warn_of_lost_slices(images, info);
  warn_of_scales(images, info);
}

namespace {

/// Parts of one multi-frame image in files of their own (PS3.3 C.7.6.16.1.3): how many there are, each tells, or the
/// highest number does.
void warn_of_missing_parts(const std::vector<ScannedFile>& files, SeriesInfo& info) {
  struct Parts {
    std::set<double> here;
    double told = 0;
  };
  std::map<std::string, Parts> of_concatenation;
  for (const auto& file : files) {
    const auto part = number_of(file, tag::in_concatenation);
    if (!part || !file.header.has(tag::concatenation)) continue;
    Parts& parts = of_concatenation[file.header.value(tag::concatenation)];
    parts.here.insert(*part);
    parts.told = std::max({parts.told, *part, number_of(file, tag::in_concatenation_total).value_or(0)});
  }
  for (const auto& [uid, parts] : of_concatenation)
    if (const auto here = static_cast<double>(parts.here.size()); here < parts.told)
      info.warnings.push_back(fmt::format(
          "{:g} of the {:g} files that one image was divided into are here, {} and {}: slices are missing",
          here, parts.told, to_string(tag::in_concatenation), to_string(tag::in_concatenation_total)));
}

}  // namespace

void add_warnings(const std::vector<ScannedFile>& files, const std::vector<SeriesImage>& images,
                  SeriesInfo& info) {
  const SeriesImage& first = images.front();
  warn_of_missing_parts(files, info);
  warn_of_files(
      files, [](const auto& file) { return file.end.stray_bits; },
      "samples have bits set outside " + to_string(tag::bits_stored) + "; they are masked", info);
  warn_of_files(
      files, [](const auto& file) { return file.end.extra_bytes > 0; },
      to_string(tag::pixel_data) + " is longer than its image; the rest is ignored", info);
  warn_of_files(
      files, [](const auto& file) { return !file.header.has(tag::study_instance); },
      to_string(tag::study_instance) +
          " is absent: the report's DICOM objects will belong to a study of their own, under a pseudonym",
      info);
  warn_of_files(
      files, [](const auto& file) { return is_contradicted(file.header); },
      fmt::format("{} contradicts {}, which is used: the head may be mirrored",
                  to_string(tag::patient_orientation), to_string(tag::image_orientation)),
      info);
  warn_of_files(
      files,
      [](const auto& file) { return file.header.unreadable.count(tag::series_description.keyword) > 0; },
      to_string(tag::series_description) + " is not in the character set " + to_string(tag::character_set) +
          ", or in one that cannot be converted; it is left out",
      info);
  warn_of_files(
      files, [](const auto& file) { return file.header.value(tag::lossy_compression) == "01"; },
      to_string(tag::lossy_compression) + " says that the image was compressed with loss", info);
  warn_of_files(
      files, [](const auto& file) { return !is_persons(file.header.value(tag::patient_species)); },
      to_string(tag::patient_species) + " names no human: priors, limits and reports are of people", info);
  if (!shows_head(info.body_part))
    info.warnings.push_back(to_string(tag::body_part) + " is " + in_quotes(info.body_part) +
                            ", not the head");
  for (const auto& [tag, value] : {std::pair{tag::field_strength, info.field_strength_T},
                                   std::pair{tag::pixel_bandwidth, info.pixel_bandwidth_Hz}})
    if (const std::string& told = first.value(tag); !told.empty() && !value)
      info.warnings.push_back(to_string(tag) + " is " + in_quotes(told) + ", no scanner's; it is not used");
  if (info.private_scaling)
    info.warnings.push_back(
        fmt::format("Philips private scaling (2005,100e) {:g}, (2005,100d) {:g} is recorded, not applied",
                    (*info.private_scaling)[0], (*info.private_scaling)[1]));
  if (!info.slice_thickness_mm)
    info.warnings.push_back(to_string(tag::slice_thickness) +
                            (first.value(tag::slice_thickness).empty() ? " is absent" : " is no slice's") +
                            "; the slice spacing is taken");
  warn_of_files(
      files,
      [](const auto& file) {
        return file.header.has(tag::patient_age) && !parse_age_years(file.header.value(tag::patient_age));
      },
      fmt::format("{} is no age above 0 and of at most {:g} years, and is not used; --age gives it",
                  to_string(tag::patient_age), human_age_years.high),
      info);
  warn_of_image_type(images, info);
  warn_of_times(info);
  warn_of_lengths(first, info);
}

}  // namespace emmetrope::segmentation
