#include "pipeline/base/checked_object.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::raytrace {
namespace {

/// The file's surfaces as an eye of their own: its reader and its checks do the work. The eye's own media may
/// be named in it; a retina behind everything ends the list.
EyeModel as_eye(CheckedObject& top, const EyeModel& eye, const std::filesystem::path& folder) {
  Json json{{"reference_wavelength_nm", top.number("reference_wavelength_nm", eye.reference_wavelength_nm)},
            {"media", top.has("media") ? top.get("media") : Json::object()},
            {"surfaces", top.get("surfaces")}};
  if (!json["media"].is_object()) throw top.fault("media", "expected an object of media by name");
  if (!json["surfaces"].is_array() || json["surfaces"].empty())
    throw top.fault("surfaces", "expected a list of at least one surface");
  for (const auto& [name, medium] : eye.media) {
    if (json["media"].contains(name))
      throw top.fault("media", "\"" + name + "\" is a medium of the eye already; choose another name");
    json["media"][name] = {{"index", 1.0}};
  }
  if (json["media"].empty()) json["media"]["air"] = {{"index", 1.0}};
  constexpr double behind_everything_mm = 1000;
  json["surfaces"].push_back({{"name", "retina"}, {"type", "plane"}, {"position_mm", behind_everything_mm}});
  return eye_from_json(json, folder);
}

}  // namespace

EyeModel with_surfaces_of(const EyeModel& eye, const std::filesystem::path& file) {
  const Json json = read_json(file);
  EyeModel result = eye;
  try {
    CheckedObject top(json, "spectacle");
    top.text("name", "spectacle");
    EyeModel worn = as_eye(top, eye, file.parent_path());
    worn.surfaces.pop_back();
    if (top.has("removes")) {
      const Json& names = top.get("removes");
      if (!names.is_array()) throw top.fault("removes", "expected a list of surface names");
      for (const Json& name : names) {
        const auto found = std::find_if(
            result.surfaces.begin(), std::prev(result.surfaces.end()),
            [&](const Surface& s) { return name.is_string() && s.name == name.get<std::string>(); });
        if (found == std::prev(result.surfaces.end()))
          throw top.fault("removes", "the eye has no surface " + name.dump() + " to remove");
        result.surfaces.erase(found);
      }
    }
    top.finish();
    for (auto& [name, medium] : worn.media) {
      if (eye.media.count(name) != 0) continue;
      if (!medium.gradient)
        medium.index = medium.index_at(eye.reference_wavelength_nm, worn.reference_wavelength_nm);
      result.media[name] = medium;
    }
    for (const Surface& surface : worn.surfaces) {
      const auto behind = std::find_if(result.surfaces.begin(), result.surfaces.end(),
                                       [&](const Surface& s) { return s.position_mm > surface.position_mm; });
      for (const Surface& other : result.surfaces)
        if (other.name == surface.name || (other.is_stop() && surface.is_stop()))
          throw input_error("surface \"" + surface.name + "\": the eye has \"" + other.name + "\" already",
                            "choose another name, or name it under \"removes\"");
      if (behind == result.surfaces.end())
        throw input_error("surface \"" + surface.name + "\": key \"position_mm\": lies behind the retina");
      result.surfaces.insert(behind, surface);
    }
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
  return result;
}

}  // namespace emmetrope::raytrace
