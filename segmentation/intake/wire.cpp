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

bool is_nifti_name(const std::filesystem::path& file) {
  const auto stem_of_gz = file.extension() == ".gz" ? file.stem() : file;
  return stem_of_gz.extension() == ".nii";
}

void to_json(Json& json, const VolumeHeader& header) {
  const Stack& g = header.geometry;
  const auto vector = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  json = {{"columns", g.columns},
          {"rows", g.rows},
          {"along_row", vector(g.along_row)},
          {"along_column", vector(g.along_column)},
          {"normal", vector(g.normal)},
          {"column_spacing_mm", g.column_spacing_mm},
          {"row_spacing_mm", g.row_spacing_mm},
          {"slice_thickness_mm", g.slice_thickness_mm},
          {"slice_position", Json::array()},
          {"sidecar", header.sidecar},
          {"warnings", header.warnings},
          {"error", header.error},
          {"remedy", header.remedy},
          {"status", static_cast<int>(header.status)}};
  for (const Eigen::Vector3d& position : g.slice_position) json["slice_position"].push_back(vector(position));
}

void from_json(const Json& json, VolumeHeader& header) {
  Stack& g = header.geometry;
  const auto vector = [](const Json& v) {
    return Eigen::Vector3d(v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>());
  };
  json.at("error").get_to(header.error);
  json.at("remedy").get_to(header.remedy);
  header.status = static_cast<ExitStatus>(json.at("status").get<int>());
  json.at("warnings").get_to(header.warnings);
  json.at("sidecar").get_to(header.sidecar);
  if (!header.error.empty()) return;
  json.at("columns").get_to(g.columns);
  json.at("rows").get_to(g.rows);
  g.along_row = vector(json.at("along_row"));
  g.along_column = vector(json.at("along_column"));
  g.normal = vector(json.at("normal"));
  json.at("column_spacing_mm").get_to(g.column_spacing_mm);
  json.at("row_spacing_mm").get_to(g.row_spacing_mm);
  json.at("slice_thickness_mm").get_to(g.slice_thickness_mm);
  for (const Json& position : json.at("slice_position")) g.slice_position.push_back(vector(position));
}

void to_json(Json& json, const ImageHeader& header) {
  json = {{"kind", static_cast<int>(header.kind)},
          {"reason", header.reason},
          {"transfer_syntax", header.transfer_syntax},
          {"description", header.description},
          {"unreadable", header.unreadable},
          {"data_set", header.data_set},
          {"frames", header.frames}};
}

void from_json(const Json& json, ImageHeader& header) {
  header.kind = static_cast<FileKind>(json.at("kind").get<int>());
  json.at("reason").get_to(header.reason);
  json.at("transfer_syntax").get_to(header.transfer_syntax);
  json.at("description").get_to(header.description);
  json.at("unreadable").get_to(header.unreadable);
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
