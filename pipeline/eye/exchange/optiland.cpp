#include "pipeline/eye/exchange/optiland.hpp"

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/exchange/lens_system.hpp"

namespace emmetrope {
namespace {

double number_at(const Json& object, const char* key, const std::string& place) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_number())
    throw input_error(place + ": key \"" + key + "\": expected a number");
  return object[key].get<double>();
}

std::string text_at(const Json& object, const char* key, const std::string& place) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_string())
    throw input_error(place + ": key \"" + key + "\": expected a text");
  return object[key].get<std::string>();
}

Eigen::Isometry3d pose_of(const Json& cs, const std::string& place) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (cs.contains("reference_cs") && cs["reference_cs"].is_object())
    pose = pose_of(cs["reference_cs"], place);
  pose.translate(
      Eigen::Vector3d(number_at(cs, "x", place), number_at(cs, "y", place), number_at(cs, "z", place)));
  pose.rotate(Eigen::AngleAxisd(number_at(cs, "rx", place), Eigen::Vector3d::UnitX()) *
              Eigen::AngleAxisd(number_at(cs, "ry", place), Eigen::Vector3d::UnitY()) *
              Eigen::AngleAxisd(number_at(cs, "rz", place), Eigen::Vector3d::UnitZ()));
  return pose;
}

ShapePtr shape_of(const Json& geometry, const std::string& place) {
  const std::string type = text_at(geometry, "type", place);
  if (type == "Plane") return make_plane();
  if (type != "StandardGeometry")
    throw unsupported_error(place + ": a geometry of type " + type + " has no counterpart in an eye");
  if (geometry.contains("radius") && geometry["radius"].is_null()) return make_plane();
  const double radius = number_at(geometry, "radius", place);
  const double q = geometry.contains("conic") ? number_at(geometry, "conic", place) : 0;
  return q == 0 ? make_sphere(radius) : make_conic(radius, q);
}

std::string add_medium(const Json& material, const std::string& place, LensSystem& system) {
  const std::string type = text_at(material, "type", place);
  Medium medium;
  if (type == "AbbeMaterial") {
    medium.dispersion = {Dispersion::Formula::abbe,
                         {number_at(material, "index", place), number_at(material, "abbe", place)}};
    medium.index = medium.dispersion.formula_index(system.wavelength_nm);
  } else if (type == "IdealMaterial") {
    medium.index = number_at(material, "index", place);
  } else {
    throw unsupported_error(place + ": a material of type " + type + " has no counterpart in an eye");
  }
  if (medium.index == 1) return "air";
  for (const auto& [name, known] : system.media)
    if (known.index == medium.index && known.dispersion.coefficients == medium.dispersion.coefficients)
      return name;
  std::string name = "medium_" + std::to_string(system.media.size() + 1);
  system.media[name] = medium;
  return name;
}

double wavelength_nm_of(const Json& json) {
  const std::string place = "wavelengths";
  for (const Json& wavelength :
       json.value("wavelengths", Json::object()).value("wavelengths", Json::array())) {
    if (!wavelength.is_object() || !wavelength.value("is_primary", false)) continue;
    const double value = number_at(wavelength, "value", place);
    // Some versions say um of nanometres.
    return wavelength.value("unit", "um") == "um" && value < 100 ? 1000 * value : value;
  }
  throw input_error(place + ": none is primary");
}

void take_aperture(const Json& json, LensSystem& system) {
  const Json aperture = json.value("aperture", Json());
  if (!aperture.is_object()) return;
  const std::string type = text_at(aperture, "type", "aperture");
  if (type == "float_by_stop_size")
    system.stop_diameter_mm = number_at(aperture, "value", "aperture");
  else if (type == "EPD")
    system.entrance_pupil_mm = number_at(aperture, "value", "aperture");
  else
    throw unsupported_error("aperture: type " + type + " does not say how wide the pupil is");
}

}  // namespace

bool is_optiland(const std::string& text) { return text.find("\"surface_group\"") != std::string::npos; }

std::string without_infinities(std::string text) {
  for (const std::string word : {"-Infinity", "Infinity", "NaN"})
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) {
      const std::size_t before = text.find_last_not_of(" \t\r\n", at == 0 ? 0 : at - 1);
      if (before != std::string::npos && text[before] == ':') text.replace(at, word.size(), "null");
    }
  return text;
}

EyeModel eye_from_optiland(const Json& json) try {
  if (!json.is_object() || !json.contains("surface_group") || !json["surface_group"].is_object())
    throw input_error("key \"surface_group\": an object is expected");
  LensSystem system;
  const Json name = json.value("name", Json());
  system.name = name.is_string() ? name.get<std::string>() : "eye";
  system.wavelength_nm = wavelength_nm_of(json);
  take_aperture(json, system);
  const Json surfaces = json["surface_group"].value("surfaces", Json::array());
  if (!surfaces.is_array() || surfaces.size() < 3)
    throw input_error("surface_group: an object, surfaces and an image are expected");
  for (std::size_t k = 1; k < surfaces.size(); ++k) {
    const Json& from = surfaces[k];
    const std::string place = "surface_group.surfaces[" + std::to_string(k) + "]";
    const Json geometry = from.value("geometry", Json());
    if (!geometry.is_object() || !geometry.contains("cs") || !geometry["cs"].is_object())
      throw input_error(place + ": key \"geometry\": an object with \"cs\" is expected");
    if (from.value("is_reflective", false))
      throw unsupported_error(place + ": a mirror has no counterpart in an eye");
    LensSurface surface;
    surface.comment = from.value("comment", "");
    surface.is_stop = from.value("is_stop", false);
    surface.shape = shape_of(geometry, place);
    surface.light_from_surface = pose_of(geometry["cs"], place);
    surface.medium_after = add_medium(from.value("material_post", Json()), place, system);
    system.surfaces.push_back(surface);
  }
  return eye_of(system);
} catch (const Json::exception& fault) {
  throw input_error(std::string("no lens of Optiland: ") + fault.what());
}

}  // namespace emmetrope
