#include "segmentation/intake/sidecar.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <regex>

#include "pipeline/base/files.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr std::uintmax_t largest_bytes = 1'000'000;

/// The values of a sidecar, and what is wrong with them.
class Sidecar {
 public:
  Sidecar(fs::path file, Json json, std::vector<std::string>& warnings)
      : file_(std::move(file)), json_(std::move(json)), warnings_(warnings) {}

  /// In the unit of the attribute, where the sidecar has a positive number.
  void add_number(const Tag& tag, double unit, TagValues& values) const {
    const Json* value = find(tag.keyword);
    if (value == nullptr) return;
    if (!value->is_number() || !(value->get<double>() > 0)) return refuse(tag.keyword, "a positive number");
    values[tag.keyword] = fmt::format("{:.9g}", value->get<double>() * unit);
  }

  /// Code strings: a text, or a list of them. Older converters join them by "_".
  void add_codes(const Tag& tag, TagValues& values) const {
    const Json* value = find(tag.keyword);
    if (value == nullptr) return;
    std::vector<std::string> codes;
    for (const Json& part : value->is_array() ? *value : Json::array({*value})) {
      static const std::regex code(R"([A-Za-z0-9_ .+\\-]{1,64})");
      if (!part.is_string() || !std::regex_match(part.get<std::string>(), code))
        return refuse(tag.keyword, "code strings");
      std::string& upper = codes.emplace_back(part.get<std::string>());
      std::transform(upper.begin(), upper.end(), upper.begin(),
                     [](char c) { return c >= 'a' && c <= 'z' ? c - 32 : c; });
    }
    if (!codes.empty()) values[tag.keyword] = fmt::format("{}", fmt::join(codes, "\\"));
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
    return std::array{Vector3d(at(0), at(1), at(2)), Vector3d(at(3), at(4), at(5))};
  }

 private:
  const Json* find(const char* key) const {
    const auto found = json_.find(key);
    return found == json_.end() || found->is_null() ? nullptr : &*found;
  }
  void refuse(const char* key, const std::string& expected) const {
    warnings_.push_back(fmt::format("{}: {} is not used: {} expected", file_.string(), key, expected));
  }

  fs::path file_;
  Json json_;
  std::vector<std::string>& warnings_;
};

/// ROW or COL, as DICOM says it, of the volume as stored; empty along slices, or where it is not told.
std::string phase_encoding_of(const Sidecar& sidecar, const Stack& geometry) {
  for (const char* key : {"PhaseEncodingDirection", "PhaseEncodingAxis"})
    if (const auto axis = sidecar.one_of(key, {"i", "i-", "j", "j-", "k", "k-"}))
      return (*axis)[0] == 'i' ? "ROW" : (*axis)[0] == 'j' ? "COL" : "";
  // dcm2niix turns 3-D volumes and then names the axis of the DICOM images alone.
  const auto told = sidecar.one_of("InPlanePhaseEncodingDirectionDICOM", {"ROW", "COL"});
  const auto orientation = sidecar.orientation();
  if (!told || !orientation) return {};
  constexpr double same_axis = 0.99;
  const Vector3d axis = (*orientation)[*told == "ROW" ? 0 : 1].normalized();
  return std::abs(axis.dot(geometry.along_row)) > same_axis      ? "ROW"
         : std::abs(axis.dot(geometry.along_column)) > same_axis ? "COL"
                                                                 : "";
}

Json json_of(const fs::path& file) {
  if (fs::file_size(file) > largest_bytes)
    throw input_error(fmt::format("{} is larger than {} MB", file.string(), largest_bytes / 1'000'000));
  Json json = read_json(file);
  if (!json.is_object()) throw input_error(file.string() + " holds no JSON object");
  return json;
}

}  // namespace

fs::path sidecar_of(fs::path volume) {
  if (volume.extension() == ".gz") volume.replace_extension();
  return volume.replace_extension(".json");
}

TagValues read_sidecar(const fs::path& volume, const Stack& geometry, std::vector<std::string>& warnings) {
  const fs::path file = sidecar_of(volume);
  if (!is_file(file)) return {};
  TagValues values;
  try {
    const Sidecar sidecar(file, json_of(file), warnings);
    for (const Tag& tag : {tag::modality, tag::image_type, tag::scanning_sequence, tag::body_part})
      sidecar.add_codes(tag, values);
    constexpr double ms_per_s = 1000;
    for (const Tag& tag : {tag::repetition_time, tag::echo_time, tag::inversion_time})
      sidecar.add_number(tag, ms_per_s, values);
    for (const Tag& tag : {tag::field_strength, tag::pixel_bandwidth, tag::flip_angle, tag::slice_thickness})
      sidecar.add_number(tag, 1, values);
    if (const auto type = sidecar.one_of(tag::acquisition_type.keyword, {"2D", "3D"}))
      values[tag::acquisition_type.keyword] = *type;
    if (const std::string phase = phase_encoding_of(sidecar, geometry); !phase.empty())
      values[tag::phase_encoding.keyword] = phase;
  } catch (const Error& fault) {
    warnings.push_back(fault.what() + std::string(": nothing of it is used"));
  }
  return values;
}

}  // namespace emmetrope::segmentation
