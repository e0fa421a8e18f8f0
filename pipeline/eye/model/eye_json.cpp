#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/checked_object.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"

namespace emmetrope {
namespace {

using Formula = Dispersion::Formula;

/// One dispersion formula as eye.json names it, and how many coefficients it takes (0: any number).
struct FormulaKey {
  const char* key;
  Formula formula;
  std::size_t count;
};
constexpr FormulaKey formula_keys[] = {{"cauchy", Formula::cauchy, 0},
                                       {"conrady", Formula::conrady, 3},
                                       {"cornu", Formula::cornu, 3},
                                       {"herzberger", Formula::herzberger, 4},
                                       {"sellmeier", Formula::sellmeier, 0},
                                       {"schott", Formula::schott, 6},
                                       {"polynomial", Formula::polynomial, 0},
                                       {"abbe", Formula::abbe, 2},
                                       {"table", Formula::table, 0}};

constexpr double agreement_mm = 0.05;  // of a mesh with what is said of it
constexpr double densest_gas = 1.01;
constexpr double farthest_mm = 1000;  // of a surface from the corneal apex: eyes, spectacles, instruments

double read_index(CheckedObject& json, const std::string& key) {
  const double index = json.number(key);
  if (index < 1 || index > 4)
    throw json.fault(key, "a refractive index lies between 1 and 4, found " + std::to_string(index));
  return index;
}

std::vector<double> read_table(CheckedObject& json) {
  const Json& rows = json.get("table");
  std::vector<double> result;
  if (!rows.is_array() || rows.size() < 2)
    throw json.fault("table", "expected [[wavelength_nm, index], ...], two rows or more");
  for (const Json& row : rows) {
    if (!row.is_array() || row.size() != 2 || !row[0].is_number() || !row[1].is_number())
      throw json.fault("table", "expected [[wavelength_nm, index], ...], found " + row.dump());
    if (!result.empty() && row[0].get<double>() <= result[result.size() - 2])
      throw json.fault("table", "the wavelengths must ascend");
    result.push_back(row[0].get<double>());
    result.push_back(row[1].get<double>());
  }
  if (result[0] < 100) throw json.fault("table", fmt::format("wavelengths are in nm, found {:g}", result[0]));
  return result;
}

/// Below that of any glass or fluid; the densest flints have 17.
constexpr int least_abbe_number = 10;

Dispersion read_dispersion(CheckedObject& json) {
  Dispersion dispersion;
  for (const FormulaKey& entry : formula_keys) {
    if (!json.has(entry.key)) continue;
    if (dispersion.formula != Formula::constant)
      throw json.fault(entry.key, "a medium has one dispersion, and this is the second");
    dispersion.formula = entry.formula;
    dispersion.coefficients =
        entry.formula == Formula::table ? read_table(json) : json.numbers(entry.key, entry.count);
    if (entry.formula == Formula::sellmeier && dispersion.coefficients.size() % 2 != 0)
      throw json.fault(entry.key, "expected pairs B1, C1, B2, C2, ...");
    if (entry.formula == Formula::abbe &&
        (dispersion.coefficients[0] <= 1 || dispersion.coefficients[1] < least_abbe_number))
      throw json.fault(
          entry.key, fmt::format("expected [n_d > 1, Abbe number of {} or more], found [{:g}, {:g}]",
                                 least_abbe_number, dispersion.coefficients[0], dispersion.coefficients[1]));
  }
  return dispersion;
}

GradientIndex read_gradient(CheckedObject& json) {
  const Json& terms = json.get("grin");
  if (!terms.is_array() || terms.empty())
    throw json.fault("grin", "expected a list of {\"depth_power\", \"radius_power\", \"coefficient\"}");
  GradientIndex gradient;
  for (std::size_t k = 0; k < terms.size(); ++k) {
    CheckedObject term(terms[k], json.place() + ".grin[" + std::to_string(k) + "]");
    const auto power = [&](const char* key) {
      const double value = term.number(key);
      if (value < 0 || value > 20 || value != std::floor(value))
        throw term.fault(key, "must be a whole number, 0 to 20");
      return static_cast<int>(value);
    };
    gradient.terms.push_back({power("depth_power"), power("radius_power"), term.number("coefficient")});
    if (gradient.terms.back().radius_power % 2 != 0) throw term.fault("radius_power", "must be even");
    term.finish();
  }
  return gradient;
}

Medium read_medium(const std::string& name, const Json& entry, double reference_nm) {
  CheckedObject json(entry, "media." + name);
  Medium medium;
  if (json.has("grin")) {
    medium.gradient = read_gradient(json);
    medium.index = medium.gradient->index(0, 0);
    if (json.has("index") && std::abs(read_index(json, "index") - medium.index) > 1e-9)
      throw json.fault("index", "does not agree with the gradient at depth 0 and radius 0; leave it out");
    if (medium.index < 1) throw json.fault("grin", "the index at depth 0 and radius 0 is below 1");
  } else {
    medium.index = read_index(json, "index");
  }
  medium.dispersion = read_dispersion(json);
  // Close enough to see a formula's pole wherever a picture or an aberrometer looks.
  for (double nm = 380; nm <= 900; nm += 1)
    if (const double index = medium.index_at(nm, reference_nm); !(index >= 1 && index <= 4))
      throw input_error(
          fmt::format("{}: the dispersion gives an index of {:g} at {:g} nm", json.place(), index, nm));
  json.finish();
  return medium;
}

/// The only place where a name decides what a surface is.
Bearer bearer_of(const std::string& name) {
  return name.rfind("spectacle", 0) == 0 ? Bearer::head : Bearer::eye;
}

Surface read_stop(CheckedObject& json, const std::string& name) {
  Surface stop;
  stop.name = name;
  stop.position_mm = json.within("position_mm", -farthest_mm, farthest_mm);
  stop.stop_diameter_mm = json.positive("diameter_mm");
  return stop;
}

/// What an eye keeps beside its meshes (iris, frame, photoreceptors) is of the meshes that it was made with.
void require_recorded(const std::filesystem::path& mesh, const std::string& sha256) {
  if (!sha256.empty() && sha256_of_file(mesh) != sha256)
    throw input_error(
        mesh.string() + " is not the mesh that this eye was made with: its SHA-256 is another",
        "trace the case again with: emmetrope trace CASE; for a mesh that you have changed yourself "
        "leave the key \"sha256\" out");
}

Surface read_mesh_entry(CheckedObject& json, const std::string& name, const std::filesystem::path& folder,
                        const std::optional<Eigen::Isometry3d>& lps_from_eye) {
  MeshInterpolation interpolation = MeshInterpolation::smooth;
  const std::string word = json.text("interpolation", "smooth");
  if (word == "triangles")
    interpolation = MeshInterpolation::triangles;
  else if (word != "smooth")
    throw json.fault("interpolation", "must be \"smooth\" or \"triangles\", found \"" + word + "\"");
  const std::string recorded_sha256 = json.text("sha256", "");
  Surface surface;
  try {
    const std::filesystem::path file = folder / json.text("file");
    require_recorded(file, recorded_sha256);
    surface = read_mesh_surface(name, file, lps_from_eye, {}, interpolation);
  } catch (const Error& error) {
    throw Error(error.status(), json.place() + ": key \"file\": " + error.what(), error.remedy());
  }
  if (json.has("position_mm") && std::abs(json.number("position_mm") - surface.position_mm) > agreement_mm)
    throw json.fault("position_mm",
                     "rays along the axis meet the mesh, which is in the eye's frame, at depth " +
                         std::to_string(surface.position_mm) + " mm; leave the key out");
  return surface;
}

Surface read_surface(const Json& entry, std::size_t number, bool is_last, const std::filesystem::path& folder,
                     const EyeModel& eye) {
  std::string place = "surfaces[" + std::to_string(number) + "]";
  if (entry.is_object() && entry.contains("name") && entry["name"].is_string())
    place += " (" + entry["name"].get<std::string>() + ")";
  CheckedObject json(entry, place);
  const std::string name = json.text("name");
  const std::string type = json.text("type");
  Surface surface;
  if (type == "stop") {
    surface = read_stop(json, name);
  } else if (type == "mesh") {
    surface = read_mesh_entry(json, name, folder, eye.lps_from_eye);
  } else {
    surface.name = name;
    surface.shape = shape_from_json(type, json);
    surface.position_mm = json.within("position_mm", -farthest_mm, farthest_mm);
  }
  surface.bearer = bearer_of(name);
  surface.decentre_mm = json.pair("decentre_mm", {0, 0});
  json.require_magnitude("decentre_mm", surface.decentre_mm, 0, 20);
  surface.tilt_deg = json.pair("tilt_deg", {0, 0});
  if (surface.tilt_deg.cwiseAbs().maxCoeff() >= 90) throw json.fault("tilt_deg", "must be less than 90");
  if (json.has("semi_diameter_mm")) surface.semi_diameter_mm = json.positive("semi_diameter_mm");
  if (is_last) {
    if (surface.is_stop()) throw json.fault("type", "the last surface is the retina and cannot be a stop");
    if (json.has("medium_after"))
      throw json.fault("medium_after", "the last surface is the retina and has none");
  } else if (!surface.is_stop()) {
    surface.medium_after = json.text("medium_after");
    if (surface.medium_after != "air" && eye.media.count(surface.medium_after) == 0)
      throw json.fault("medium_after", "there is no medium \"" + surface.medium_after + "\" under \"media\"");
  }
  json.finish();
  return surface;
}

/// A head-borne surface with the eye's own next, stops apart, is a spectacle's last.
void require_air_behind_spectacle(const EyeModel& eye, std::size_t k, const std::string& place) {
  const Surface& surface = eye.surfaces[k];
  if (surface.bearer != Bearer::head || surface.is_stop()) return;
  const auto next = std::find_if(eye.surfaces.begin() + static_cast<std::ptrdiff_t>(k) + 1,
                                 eye.surfaces.end(), [](const Surface& other) { return !other.is_stop(); });
  if (next == eye.surfaces.end() || next->bearer == Bearer::head || surface.medium_after == "air" ||
      eye.media.at(surface.medium_after).index < densest_gas)
    return;
  throw input_error(fmt::format(
      "{}: key \"medium_after\": the spectacle's \"{}\" reaches to the eye; has it no back surface?", place,
      surface.medium_after));
}

std::string place_of(const EyeModel& eye, std::size_t k) {
  return "surfaces[" + std::to_string(k) + "] (" + eye.surfaces[k].name + ")";
}

/// Depth in the eye, tilts left out: neighbours tilt alike.
std::optional<double> depth_at(const Surface& surface, const Eigen::Vector2d& place_mm) {
  const Eigen::Vector2d own = place_mm - surface.decentre_mm;
  if (surface.semi_diameter_mm > 0 && own.norm() > surface.semi_diameter_mm) return std::nullopt;
  const auto depth_mm = surface.shape->depth_mm(own.x(), own.y());
  return depth_mm ? std::optional(surface.position_mm + *depth_mm) : std::nullopt;
}

/// How far from the stop's middle the second surface lies in front of the first; nothing: nowhere.
std::optional<double> crossing_mm(const Surface& first, const Surface& second, const Surface& stop) {
  constexpr double central_mm = 2.5;  // there no lens of an eye ends
  constexpr int rings = 8, spokes = 16;
  for (int ring = 1; ring <= rings; ++ring)
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double angle = 2 * pi * spoke / spokes;
      const double radius_mm = std::min(stop.stop_diameter_mm / 2, central_mm) * ring / rings;
      const Eigen::Vector2d place_mm =
          stop.decentre_mm + radius_mm * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      const auto depth_mm = depth_at(first, place_mm), next_mm = depth_at(second, place_mm);
      if (depth_mm && next_mm && *depth_mm > *next_mm + agreement_mm) return radius_mm;
    }
  return std::nullopt;
}

/// Surfaces of the eye that crossed in the middle of the iris would be a pupil that nobody asked for. A body within one
/// medium, a lens's nucleus, may end: light passes beside it.
void require_apart_within_stop(const EyeModel& eye) {
  const auto stop = std::find_if(eye.surfaces.begin(), eye.surfaces.end(),
                                 [](const Surface& surface) { return surface.is_stop(); });
  if (stop == eye.surfaces.end()) return;
  const Surface* before = nullptr;
  std::string medium_in_front = "air", medium_between;
  for (std::size_t k = 0; k < eye.surfaces.size(); ++k) {
    const Surface& surface = eye.surfaces[k];
    if (surface.is_stop() || surface.bearer == Bearer::head) continue;
    if (before != nullptr && medium_in_front != surface.medium_after)
      if (const auto radius_mm = crossing_mm(*before, surface, *stop))
        throw input_error(fmt::format("{}: it crosses {} at {:.1f} mm from the middle of the stop",
                                      place_of(eye, k), before->name, *radius_mm),
                          "correct their radii or positions");
    medium_in_front = before == nullptr ? "air" : medium_between;
    medium_between = surface.medium_after;
    before = &surface;
  }
}

/// A cornea bulges out of the eye, a retina holds it: a radius of the other sign is a slip.
void require_signs(const EyeModel& eye) {
  constexpr double away_mm = 4;  // wide of a macula's dome
  for (std::size_t k = 0; k < eye.surfaces.size(); ++k) {
    const Surface& surface = eye.surfaces[k];
    if (surface.is_stop()) continue;
    double depth_mm = 0;
    for (const Eigen::Vector2d& place : {Eigen::Vector2d(away_mm, 0), Eigen::Vector2d(-away_mm, 0),
                                         Eigen::Vector2d(0, away_mm), Eigen::Vector2d(0, -away_mm)})
      depth_mm += surface.shape->depth_mm(place.x(), place.y()).value_or(0);
    if (surface.name == "cornea_anterior" && depth_mm < 0)
      throw input_error(place_of(eye, k) + ": a cornea bulges out of the eye: its radius is positive");
    if (surface.name == "retina" && depth_mm > 0)
      throw input_error(place_of(eye, k) + ": a retina bulges away from the lens: its radius is negative");
  }
}

void check_order(const EyeModel& eye) {
  for (std::size_t k = 0; k < eye.surfaces.size(); ++k) {
    const Surface& surface = eye.surfaces[k];
    const std::string place = place_of(eye, k);
    for (std::size_t before = 0; before < k; ++before) {
      if (eye.surfaces[before].name == surface.name)
        throw input_error(place + ": key \"name\": there is another surface of that name");
      if (surface.is_stop() && eye.surfaces[before].is_stop())
        throw input_error(place + ": key \"type\": an eye has one stop, and this is the second");
    }
    if (surface.bearer == Bearer::head && surface.position_mm >= 0)
      throw input_error(
          fmt::format(
              "{}: key \"position_mm\": a spectacle stands in front of the cornea, but it lies at depth {:g} mm",
              place, surface.position_mm),
          "write a negative depth; what is in the eye has a name that does not begin with \"spectacle\"");
    // A stop at a lens that is a mesh may have been put where its facets are.
    const double tolerance_mm =
        k > 0 && eye.surfaces[k - 1].is_stop() && mesh_of(surface) ? agreement_mm : 1e-9;
    if (k > 0 && surface.position_mm < eye.surfaces[k - 1].position_mm - tolerance_mm)
      throw input_error(
          place + ": key \"position_mm\": " + std::to_string(surface.position_mm) +
          " lies in front of the surface before it; surfaces stand in the order that light meets them");
    // Depths, pupils, spectacles and the retina's points count from there.
    if (surface.name == "cornea_anterior" && std::abs(surface.position_mm) > agreement_mm)
      throw input_error(fmt::format(
          "{}: key \"position_mm\": the corneal apex is the eye's origin, but it lies at depth {:g} mm",
          place, surface.position_mm));
    require_air_behind_spectacle(eye, k, place);
  }
}

Json medium_json(const Medium& medium) {
  Json json = Json::object();
  if (medium.gradient) {
    json["grin"] = Json::array();
    for (const GradientIndex::Term& term : medium.gradient->terms)
      json["grin"].push_back({{"depth_power", term.depth_power},
                              {"radius_power", term.radius_power},
                              {"coefficient", term.coefficient}});
  } else {
    json["index"] = medium.index;
  }
  for (const FormulaKey& entry : formula_keys) {
    if (entry.formula != medium.dispersion.formula) continue;
    const std::vector<double>& values = medium.dispersion.coefficients;
    if (entry.formula == Formula::table) {
      json[entry.key] = Json::array();
      for (std::size_t k = 0; k + 1 < values.size(); k += 2)
        json[entry.key].push_back({values[k], values[k + 1]});
    } else {
      json[entry.key] = values;
    }
  }
  return json;
}

Json surface_json(const Surface& surface) {
  Json json{{"name", surface.name}};
  if (surface.is_stop()) {
    json["type"] = "stop";
    json["position_mm"] = surface.position_mm;
    json["diameter_mm"] = surface.stop_diameter_mm;
  } else {
    const Json form = surface.shape->to_json();
    json["type"] = form["type"];
    json["position_mm"] = surface.position_mm;
    for (const auto& [key, value] : form.items()) json[key] = value;
  }
  if (surface.semi_diameter_mm > 0) json["semi_diameter_mm"] = surface.semi_diameter_mm;
  if (!surface.decentre_mm.isZero(0))
    json["decentre_mm"] = {surface.decentre_mm.x(), surface.decentre_mm.y()};
  if (!surface.tilt_deg.isZero(0)) json["tilt_deg"] = {surface.tilt_deg.x(), surface.tilt_deg.y()};
  if (!surface.medium_after.empty()) json["medium_after"] = surface.medium_after;
  return json;
}

}  // namespace

EyeModel eye_from_json(const Json& json, const std::filesystem::path& folder) {
  CheckedObject top(json, "eye");
  EyeModel eye;
  eye.name = top.text("name", "eye");
  eye.reference_wavelength_nm = top.positive("reference_wavelength_nm");
  if (eye.reference_wavelength_nm < 200 || eye.reference_wavelength_nm > 2500)
    throw top.fault("reference_wavelength_nm", "must lie between 200 and 2500 nm");
  if (top.has("lps_from_eye")) {
    try {
      eye.lps_from_eye = isometry_from_json(top.get("lps_from_eye"));
    } catch (const Error& error) {
      throw top.fault("lps_from_eye", error.what());
    }
  }
  const Json& media = top.get("media");
  if (!media.is_object() || media.empty()) throw top.fault("media", "expected an object of media by name");
  for (const auto& [name, entry] : media.items())
    eye.media[name] = read_medium(name, entry, eye.reference_wavelength_nm);
  if (const auto air = eye.media.find("air"); air != eye.media.end() && air->second.index > densest_gas)
    throw input_error(fmt::format("media.air: air has the index 1, found {:g}", air->second.index),
                      "call the medium otherwise");
  const Json& surfaces = top.get("surfaces");
  if (!surfaces.is_array() || surfaces.size() < 2)
    throw top.fault("surfaces", "expected a list of at least two surfaces, the retina last");
  for (std::size_t k = 0; k < surfaces.size(); ++k)
    eye.surfaces.push_back(read_surface(surfaces[k], k, k + 1 == surfaces.size(), folder, eye));
  top.finish();
  check_order(eye);
  require_signs(eye);
  require_apart_within_stop(eye);
  return eye;
}

EyeModel read_eye(const std::filesystem::path& file) {
  const Json json = read_json(file);
  try {
    return eye_from_json(json, file.parent_path());
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
}

Json to_json(const EyeModel& eye) {
  Json json{{"name", eye.name}, {"reference_wavelength_nm", eye.reference_wavelength_nm}};
  if (eye.lps_from_eye) json["lps_from_eye"] = to_json_matrix(*eye.lps_from_eye);
  json["media"] = Json::object();
  for (const auto& [name, medium] : eye.media) json["media"][name] = medium_json(medium);
  json["surfaces"] = Json::array();
  for (const Surface& surface : eye.surfaces) json["surfaces"].push_back(surface_json(surface));
  return json;
}

void write_eye(const std::filesystem::path& file, const EyeModel& eye) {
  Json json = to_json(eye);
  const std::filesystem::path folder = std::filesystem::absolute(file).parent_path();
  for (Json& surface : json["surfaces"])
    if (surface.contains("file"))
      surface["file"] = std::filesystem::proximate(surface["file"].get<std::string>(), folder).string();
  write_json(file, json);
}

}  // namespace emmetrope
