#include "segmentation/intake/wire.hpp"

#include <fmt/format.h>

namespace emmetrope::segmentation {

std::string to_string(const Tag& tag) {
  return fmt::format("({:04x},{:04x}) {}", tag.group, tag.element, tag.keyword);
}

const std::string& ImageHeader::value(const Tag& tag, int frame) const {
  static const std::string absent;
  if (frame >= 0 && frame < static_cast<int>(frames.size())) {
    const auto found = frames[frame].find(tag.keyword);
    if (found != frames[frame].end()) return found->second;
  }
  const auto found = data_set.find(tag.keyword);
  return found == data_set.end() ? absent : found->second;
}

void to_json(Json& json, const ImageHeader& header) {
  json = {{"kind", static_cast<int>(header.kind)},
          {"reason", header.reason},
          {"transfer_syntax", header.transfer_syntax},
          {"description", header.description},
          {"description_repaired", header.description_repaired},
          {"data_set", header.data_set},
          {"frames", header.frames}};
}

void from_json(const Json& json, ImageHeader& header) {
  header.kind = static_cast<FileKind>(json.at("kind").get<int>());
  json.at("reason").get_to(header.reason);
  json.at("transfer_syntax").get_to(header.transfer_syntax);
  json.at("description").get_to(header.description);
  json.at("description_repaired").get_to(header.description_repaired);
  json.at("data_set").get_to(header.data_set);
  json.at("frames").get_to(header.frames);
}

void to_json(Json& json, const DecodeEnd& end) {
  json = {{"error", end.error},
          {"unsupported", end.unsupported},
          {"stray_bits", end.stray_bits},
          {"extra_bytes", end.extra_bytes}};
}

void from_json(const Json& json, DecodeEnd& end) {
  json.at("error").get_to(end.error);
  json.at("unsupported").get_to(end.unsupported);
  json.at("stray_bits").get_to(end.stray_bits);
  json.at("extra_bytes").get_to(end.extra_bytes);
}

}  // namespace emmetrope::segmentation
