#include "segmentation/intake/sidecar.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <regex>
#include <set>

#include "pipeline/base/files.hpp"
#include "segmentation/intake/plausible.hpp"
#include "segmentation/intake/sidecar_files.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr std::uintmax_t largest_bytes = 1'000'000;

/// What an attribute may be, in DICOM's unit.
struct Range {
  double least, largest;
};

struct SidecarFile {
  fs::path file;
  Json json;
};

/// The values of a volume's sidecars, and what is wrong with them.
class Sidecars {
 public:
  /// \param files  the nearest first: what one tells, the later ones do not
  Sidecars(std::vector<SidecarFile> files, std::vector<std::string>& warnings)
      : files_(std::move(files)), warnings_(warnings) {}

  /// \param unit  of the sidecar's number, in DICOM's
  void add_number(const Tag& tag, const Range& range, double unit, TagValues& values) const {
    const Json* value = find(tag.keyword);
    if (value == nullptr) return;
    const double number = value->is_number() ? value->get<double>() * unit : 0;
    if (!(number >= range.least && number <= range.largest))
      return refuse(tag.keyword,
                    fmt::format("a number from {:g} to {:g}", range.least / unit, range.largest / unit));
    values[tag.keyword] = fmt::format("{:.9g}", number);
  }

  /// The times, in DICOM's unit; none of them where the echo is later than any is: milliseconds look like long seconds.
  void add_times(TagValues& values) const {
    constexpr double ms_per_s = 1000, longest_echo_s = 1;
    constexpr Range times_ms{1e-3, 1e5};
    const auto seconds = [&](const Tag& tag) {
      const Json* value = find(tag.keyword);
      return value != nullptr && value->is_number() ? value->get<double>() : 0;
    };
    const double echo_s = seconds(tag::echo_time), repetition_s = seconds(tag::repetition_time);
    if (echo_s > longest_echo_s || (repetition_s > 0 && echo_s > repetition_s)) {
      warnings_.push_back(
          fmt::format("{}: EchoTime is {:g} s, longer than {}; no time of it is used: are they in seconds?",
                      file_with(tag::echo_time.keyword)->file.string(), echo_s,
                      echo_s > longest_echo_s ? fmt::format("{:g} s", longest_echo_s)
                                              : fmt::format("RepetitionTime, {:g} s", repetition_s)));
      return;
    }
    for (const Tag& tag : {tag::repetition_time, tag::echo_time, tag::inversion_time})
      add_number(tag, times_ms, ms_per_s, values);
  }

  /// Code strings: a list of them, or one text, in which some converters join them by "_".
  void add_codes(const Tag& tag, TagValues& values) const {
    constexpr std::size_t most = 64;
    const Json* value = find(tag.keyword);
    if (value == nullptr) return;
    std::string codes;
    for (const Json& part : value->is_array() ? *value : Json::array({*value})) {
      static const std::regex code(R"([A-Za-z0-9_ .+\\-]{0,64})");
      if (!part.is_string() || !std::regex_match(part.get<std::string>(), code) || value->size() > most)
        return refuse(tag.keyword, "code strings");
      for (char c : part.get<std::string>())
        codes += c >= 'a' && c <= 'z'             ? static_cast<char>(c - 'a' + 'A')
                 : c == '_' && !value->is_array() ? '\\'
                                                  : c;
      codes += '\\';
    }
    while (!codes.empty() && codes.back() == '\\') codes.pop_back();
    if (!codes.empty()) values[tag.keyword] = codes;
  }

  /// What BIDS and converters call the sequence, in the attributes by which echo-planar ones are known.
  void add_sequence(TagValues& values) const {
    static const std::regex name(R"([A-Za-z0-9_*#]{1,16})"),
        echo_planar(R"((.*[^A-Z])?EPI([^A-Z].*)?)", std::regex::icase);
    const auto text = [&](const char* key) {
      const Json* value = find(key);
      return value != nullptr && value->is_string() ? value->get<std::string>().substr(0, 64) : std::string();
    };
    for (const char* key : {"PulseSequenceName", "SequenceName"})
      if (const std::string told = text(key); std::regex_match(told, name))
        values[tag::sequence_name.keyword] = told;
    if (std::regex_match(text("PulseSequenceType"), echo_planar)) values[tag::echo_planar.keyword] = "YES";
  }

  /// The value where it is one of these texts.
  std::optional<std::string> one_of(const char* key, const std::vector<std::string>& texts) const {
    const Json* value = find(key);
    if (value == nullptr) return std::nullopt;
    for (const std::string& text : texts)
      if (*value == text) return text;
    refuse(key, fmt::format("one of {}", fmt::join(texts, ", ")));
    return std::nullopt;
  }

  /// Direction cosines of a row and of a column of the images that were converted, LPS.
  std::optional<std::array<Vector3d, 2>> orientation() const {
    constexpr const char* key = "ImageOrientationPatientDICOM";
    const Json* value = find(key);
    if (value == nullptr) return std::nullopt;
    const bool is_six =
        value->is_array() && value->size() == 6 &&
        std::all_of(value->begin(), value->end(), [](const Json& v) { return v.is_number(); });
    if (!is_six) {
      refuse(key, "six numbers");
      return std::nullopt;
    }
    const auto at = [&](std::size_t i) { return value->at(i).get<double>(); };
    return std::array{Vector3d(at(0), at(1), at(2)).normalized(), Vector3d(at(3), at(4), at(5)).normalized()};
  }

 private:
  const SidecarFile* file_with(const char* key) const {
    const auto found = std::find_if(files_.begin(), files_.end(),
                                    [&](const SidecarFile& told) { return told.json.contains(key); });
    return found == files_.end() ? nullptr : &*found;
  }
  /// Null where there is none, or an empty one.
  const Json* find(const char* key) const {
    const SidecarFile* told = file_with(key);
    if (told == nullptr) return nullptr;
    const Json& value = told->json.at(key);
    return value.is_null() || value == "" ? nullptr : &value;
  }
  /// \pre there is such a key
  void refuse(const char* key, const std::string& expected) const {
    warnings_.push_back(
        fmt::format("{}: {} is not used: {} expected", file_with(key)->file.string(), key, expected));
  }

  std::vector<SidecarFile> files_;
  std::vector<std::string>& warnings_;
};

bool is_along(const Vector3d& a, const Vector3d& b) {
  constexpr double same_axis = 0.99;
  return std::abs(a.dot(b)) > same_axis;
}

/// InPlanePhaseEncodingDirection of the volume as stored; empty where it is not told.
/// \param orientation  of the images that were converted: dcm2niix turns 3-D volumes, and what it then says of the
///   volume's axes may still be of those images'
std::string phase_encoding_of(const Sidecars& sidecars,
                              const std::optional<std::array<Vector3d, 2>>& orientation, bool may_be_turned,
                              const Stack& geometry) {
  const auto of_images = sidecars.one_of("InPlanePhaseEncodingDirectionDICOM", {"ROW", "COL"});
  if (of_images && orientation) {
    const Vector3d readout = (*orientation)[*of_images == "ROW" ? 1 : 0];
    return is_along(readout, geometry.along_row)      ? "COL"
           : is_along(readout, geometry.along_column) ? "ROW"
           : is_along(readout, geometry.normal)       ? both_phase_encodings
                                                      : "";
  }
  if (may_be_turned) return {};
  for (const char* key : {"PhaseEncodingDirection", "PhaseEncodingAxis"})
    if (const auto axis = sidecars.one_of(key, {"i", "i-", "j", "j-", "k", "k-"}))
      return (*axis)[0] == 'i' ? "ROW" : (*axis)[0] == 'j' ? "COL" : "";
  return {};
}

/// JSON has neither NaN nor infinities, which Python writes all the same: as `false`, which is no attribute's, each of
/// them spoils its own field alone.
std::string without_nan(const std::string& text) {
  static const std::set<std::string> no_numbers{"nan", "inf", "infinity"};
  const auto is_letter = [](char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0; };
  std::string json;
  for (std::size_t first = 0, end = 0; first < text.size(); first = end) {
    end = first + 1;
    if (text[first] == '"') {
      while (end < text.size() && text[end] != '"') end += text[end] == '\\' ? 2 : 1;
      end = std::min(end + 1, text.size());
    } else if (is_letter(text[first])) {
      while (end < text.size() && is_letter(text[end])) ++end;
    }
    std::string word = text.substr(first, end - first), small = word;
    std::transform(small.begin(), small.end(), small.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (no_numbers.count(small) > 0) {
      word = "false";
      if (!json.empty() && json.back() == '-') json.pop_back();
    }
    json += word;
  }
  return json;
}

/// What is wrong with the text is not told: it may be a person's name.
Json json_of(const fs::path& file) {
  if (!is_file(file)) throw input_error(file.string() + " is a link to nothing");
  if (fs::file_size(file) > largest_bytes)
    throw input_error(fmt::format("{} is larger than {} MB", file.string(), largest_bytes / 1'000'000));
  const std::string text = without_nan(read_file(file));
  Json json;
  try {
    json = parse_json(text, "");
  } catch (const Error&) {
    json = nullptr;
  }
  if (!json.is_object()) throw input_error(file.string() + " is no valid JSON object");
  return json;
}

}  // namespace

TagValues read_sidecar(const fs::path& volume, const Stack& geometry, std::vector<std::string>& warnings) {
  std::vector<SidecarFile> files;
  for (const fs::path& file : sidecars_of(volume)) {
    try {
      files.push_back({file, json_of(file)});
    } catch (const Error& fault) {
      warnings.push_back(fault.what() + std::string(": nothing of it is used"));
    }
  }
  TagValues values;
  const Sidecars sidecars(std::move(files), warnings);
  for (const Tag& tag : {tag::modality, tag::image_type, tag::scanning_sequence, tag::body_part})
    sidecars.add_codes(tag, values);
  sidecars.add_sequence(values);
  sidecars.add_times(values);
  sidecars.add_number(tag::field_strength, {least_field_T, largest_field_T}, 1, values);
  sidecars.add_number(tag::pixel_bandwidth, {least_bandwidth_Hz, largest_bandwidth_Hz}, 1, values);
  sidecars.add_number(tag::flip_angle, {0.1, 360}, 1, values);
  const auto type = sidecars.one_of(tag::acquisition_type.keyword, {"2D", "3D"});
  if (type) values[tag::acquisition_type.keyword] = *type;
  const auto orientation = sidecars.orientation();
  const bool is_as_acquired =
      orientation ? is_along((*orientation)[0].cross((*orientation)[1]), geometry.normal) : type == "2D";
  // Slices of a volume that was turned are others than those that were acquired.
  if (is_as_acquired)
    sidecars.add_number(tag::slice_thickness, {least_spacing_mm, largest_spacing_mm}, 1, values);
  if (const std::string phase = phase_encoding_of(sidecars, orientation, !is_as_acquired, geometry);
      !phase.empty())
    values[tag::phase_encoding.keyword] = phase;
  return values;
}

}  // namespace emmetrope::segmentation
