#include "raytrace/scene/scene_json.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/json.hpp"
#include "raytrace/scene/chart.hpp"
#include "raytrace/scene/model_file.hpp"
#include "raytrace/scene/panorama.hpp"
#include "raytrace/scene/picture.hpp"

namespace emmetrope::raytrace {
namespace {

/// One object of the file: keys are checked, and unknown ones named.
class Object {
 public:
  Object(const Json& json, std::string place, const std::set<std::string>& known)
      : json_(json), place_(std::move(place)) {
    if (!json.is_object()) throw input_error(place_ + " is no object");
    for (const auto& [key, value] : json.items())
      if (known.count(key) == 0) throw input_error(place_ + ": unknown key \"" + key + "\"");
  }
  bool has(const char* key) const { return json_.contains(key); }
  std::string text(const char* key) const {
    if (!has(key) || !json_[key].is_string()) throw fault(key, "a text is needed");
    return json_[key].get<std::string>();
  }
  Eigen::Vector3d vector(const char* key) const {
    if (!has(key)) throw fault(key, "three numbers are needed");
    const Json& value = json_[key];
    if (!value.is_array() || value.size() != 3) throw fault(key, "three numbers are needed");
    Eigen::Vector3d result;
    for (int i = 0; i < 3; ++i) {
      if (!value[i].is_number()) throw fault(key, "three numbers are needed");
      result[i] = value[i].get<double>();
    }
    return result;
  }
  double number(const char* key, double otherwise) const {
    if (!has(key)) return otherwise;
    if (!json_[key].is_number()) throw fault(key, "a number is needed");
    return json_[key].get<double>();
  }
  double positive(const char* key, double otherwise) const {
    const double value = number(key, otherwise);
    if (!(value > 0)) throw fault(key, "must be greater than 0");
    return value;
  }
  Eigen::Vector3d vector(const char* key, const Eigen::Vector3d& otherwise) const {
    return has(key) ? vector(key) : otherwise;
  }
  /// Red, green and blue of linear light.
  Eigen::Vector3d light(const char* key, const Eigen::Vector3d& otherwise, double most) const {
    Eigen::Vector3d value = vector(key, otherwise);
    if ((value.array() < 0).any() || (value.array() > most).any())
      throw fault(key, "linear light from 0 to " + std::to_string(static_cast<int>(most)) + " is needed");
    return value;
  }
  std::vector<double> numbers(const char* key) const {
    if (!has(key) || !json_[key].is_array() || json_[key].empty())
      throw fault(key, "a list of numbers is needed");
    std::vector<double> values;
    for (const Json& value : json_[key]) {
      if (!value.is_number()) throw fault(key, "a list of numbers is needed");
      values.push_back(value.get<double>());
    }
    return values;
  }
  /// Numbers that rise.
  std::vector<double> rising(const char* key) const {
    std::vector<double> values = numbers(key);
    if (std::adjacent_find(values.begin(), values.end(), std::greater_equal<>()) != values.end())
      throw fault(key, "numbers that rise are needed");
    return values;
  }
  /// {"wavelengths_nm": [...], "values": [...]} from 0 to `most`.
  std::optional<SampledSpectrum> spectrum(const char* key, double most) const {
    if (!has(key)) return std::nullopt;
    const Object of_key(json_[key], place_ + ": key \"" + key + "\"", {"wavelengths_nm", "values"});
    SampledSpectrum spectrum{of_key.rising("wavelengths_nm"), of_key.numbers("values")};
    if (spectrum.values.size() != spectrum.wavelength_nm.size())
      throw of_key.fault("values", "as many as wavelengths_nm are needed");
    if (spectrum.wavelength_nm.front() > 780 || spectrum.wavelength_nm.back() < 380)
      throw of_key.fault("wavelengths_nm", "none of them is light's, 380 to 780 nm");
    for (const double value : spectrum.values)
      if (!(value >= 0 && value <= most))
        throw of_key.fault("values", fmt::format("0 to {:g} are needed", most));
    return spectrum;
  }
  bool flag(const char* key) const {
    if (!has(key)) return false;
    if (!json_[key].is_boolean()) throw fault(key, "true or false is needed");
    return json_[key].get<bool>();
  }
  Error fault(const std::string& key, const std::string& what, const std::string& remedy = {}) const {
    return input_error(place_ + ": key \"" + key + "\": " + what, remedy);
  }

 private:
  const Json& json_;
  std::string place_;
};

const std::set<std::string> material_keys{"colour", "reflectance", "specular", "shininess", "motion_mm"};

std::set<std::string> with_material(std::set<std::string> keys) {
  keys.insert(material_keys.begin(), material_keys.end());
  return keys;
}

void read_material(const Object& object, Material& material) {
  if (object.has("colour") && object.has("reflectance"))
    throw object.fault("reflectance", "excludes \"colour\"");
  material.colour = object.light("colour", material.colour, 1);
  material.reflectance = object.spectrum("reflectance", 1);
  if (material.reflectance) material.colour = colour_of_reflectance(*material.reflectance);
  material.specular = object.number("specular", material.specular);
  material.shininess = object.positive("shininess", material.shininess);
  if (material.specular < 0) throw object.fault("specular", "must not be negative");
}

/// What moves to both sides of its place by half of `motion_mm`, where it is nearest to the apex.
Eigen::Vector3d nearest_on_way(const Eigen::Vector3d& place_mm, const Eigen::Vector3d& motion_mm) {
  const double length2 = motion_mm.squaredNorm();
  if (length2 == 0) return place_mm;
  return place_mm + std::clamp(-place_mm.dot(motion_mm) / length2, -0.5, 0.5) * motion_mm;
}

double distance_mm(const TexturedPlane& plane) {
  const Eigen::Vector3d centre = nearest_on_way(plane.centre_mm, plane.motion_mm);
  const auto towards_apex = [&](const Eigen::Vector3d& side) -> Eigen::Vector3d {
    return std::clamp(-centre.dot(side) / side.squaredNorm(), -1.0, 1.0) * side;
  };
  return (centre + towards_apex(plane.right_mm) + towards_apex(plane.up_mm)).norm();
}

double distance_mm(const std::vector<MeshObject>& meshes) {
  double distance = std::numeric_limits<double>::infinity();
  for (const MeshObject& mesh : meshes)
    for (const Eigen::Vector3d& place : mesh.positions_mm)
      distance = std::min(distance, nearest_on_way(place, mesh.motion_mm).norm());
  return distance;
}

/// Metres, or a motion through the eye.
void check_distance(const Object& object, const char* key, double distance_mm) {
  if (distance_mm < least_distance_mm)
    throw object.fault(key,
                       fmt::format("it comes to {:.3g} mm from the eye, nearer than {:g}: places, sizes and "
                                   "motions are in mm",
                                   distance_mm, least_distance_mm));
}

/// A chart as on the command line, whose faults are the file's here. Drawn for the angle under which the plane is seen
/// from the apex; its place is the plane's.
std::shared_ptr<const Texture> read_chart(const Object& object, const TexturedPlane& plane) {
  try {
    ChartSpec chart = parse_chart(object.text("chart"));
    const double distance = plane.centre_mm.norm();
    chart.distance_mm = std::max(least_distance_mm, distance);
    const Eigen::Vector2d half_mm(plane.right_mm.norm(), plane.up_mm.norm());
    chart.extent_deg = 2 * std::atan2(half_mm.maxCoeff(), distance) / degree;
    return draw_chart(chart, half_mm / half_mm.maxCoeff()).planes.front().texture;
  } catch (const Error& error) {
    if (error.status() != ExitStatus::usage) throw;
    const bool is_too_fine = std::string(error.remedy()).find("extent_deg") != std::string::npos;
    throw object.fault("chart", error.what(),
                       is_too_fine ? "a smaller plane, or larger detail" : error.remedy());
  }
}

TexturedPlane read_plane(const Object& object, const std::filesystem::path& folder,
                         std::vector<std::filesystem::path>& files) {
  if (object.has("picture") + object.has("chart") + object.has("radiance") != 1)
    throw object.fault("picture", "one of \"picture\", \"chart\" and \"radiance\" is needed");
  if (object.has("radiance") != object.has("wavelengths_nm"))
    throw object.fault("wavelengths_nm", "\"radiance\" and \"wavelengths_nm\" go together");
  TexturedPlane plane;
  plane.at_infinity = object.flag("at_infinity");
  plane.centre_mm = object.vector("centre_mm");
  plane.right_mm = object.vector("right_mm");
  plane.up_mm = object.vector("up_mm");
  plane.motion_mm = object.vector("motion_mm", plane.motion_mm);
  constexpr double largest_mm = 1e15;  // 1e9 km; squares of much longer ones are no numbers any more
  for (const auto& [key, half] : {std::pair{"right_mm", &plane.right_mm}, {"up_mm", &plane.up_mm}})
    if (!(half->cwiseAbs().maxCoeff() <= largest_mm))
      throw object.fault(key, fmt::format("longer than {:g} mm", largest_mm));
  if (!(plane.right_mm.cross(plane.up_mm).norm() > 0))
    throw object.fault("up_mm", "right_mm and up_mm span no plane");
  if (!plane.at_infinity) check_distance(object, "centre_mm", distance_mm(plane));
  if (object.has("picture")) {
    files.push_back(folder / object.text("picture"));
    plane.texture = read_picture(files.back());
  } else if (object.has("radiance")) {
    if (object.flag("lit")) throw object.fault("lit", "a radiance is shown as it is, in no other light");
    files.push_back(folder / object.text("radiance"));
    plane.spectrum = read_spectral_picture(files.back(), object.rising("wavelengths_nm"));
    plane.texture = std::make_shared<const Texture>(plane.spectrum->coloured());
  } else {
    if (plane.at_infinity && !(plane.centre_mm.z() > 0))
      throw object.fault("centre_mm",
                         "a chart at infinity is drawn for an eye that it faces: z must be above 0");
    const std::string text = object.text("chart");
    for (const char* own : {"distance_mm", "extent_deg"})
      if (text.find(own) != std::string::npos)
        throw object.fault("chart",
                           std::string(own) + " is the plane's, by its centre_mm, right_mm and up_mm");
    plane.texture = read_chart(object, plane);
  }
  return plane;
}

/// The same picture on two triangles that answer light.
MeshObject lit(const TexturedPlane& plane, const Object& object) {
  if (plane.at_infinity) throw object.fault("lit", "a plane at infinity is in no light");
  MeshObject mesh;
  for (const auto& [u, v] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}}) {
    mesh.positions_mm.push_back(plane.centre_mm + (2 * u - 1) * plane.right_mm + (2 * v - 1) * plane.up_mm);
    mesh.normals.push_back(plane.right_mm.cross(plane.up_mm).normalized());
    mesh.texture_coordinates.emplace_back(u, v);
  }
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.material.texture = plane.texture;
  read_material(object, mesh.material);
  mesh.motion_mm = plane.motion_mm;
  return mesh;
}

/// Brings a model to its place: its x to the patient's right, y up, z towards the patient, as a modelling
/// program's front view shows it.
void place(std::vector<MeshObject>& objects, const Object& object) {
  if (object.has("scale") && object.has("size_mm"))
    throw object.fault("scale", "\"scale\" and \"size_mm\" exclude each other");
  Eigen::AlignedBox3d box;
  for (const MeshObject& mesh : objects)
    for (const Eigen::Vector3d& p : mesh.positions_mm) box.extend(p);
  double scale = object.positive("scale", 1);
  Eigen::Vector3d origin(0, 0, 0);
  if (object.has("size_mm")) {
    const double size = box.sizes().maxCoeff();
    if (!(size > 0)) throw object.fault("size_mm", "all points of the model are one, which has no size");
    scale = object.positive("size_mm", 1) / size;
    origin = box.center();
  }
  const Eigen::Vector3d turn = object.vector("rotate_deg", {0, 0, 0}) * degree;
  const Eigen::Matrix3d front_view = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  const Eigen::Matrix3d rotation = front_view * Eigen::AngleAxisd(turn.z(), Eigen::Vector3d::UnitZ()) *
                                   Eigen::AngleAxisd(turn.y(), Eigen::Vector3d::UnitY()) *
                                   Eigen::AngleAxisd(turn.x(), Eigen::Vector3d::UnitX()).toRotationMatrix();
  const Eigen::Vector3d position = object.vector("position_mm");
  for (MeshObject& mesh : objects) {
    for (Eigen::Vector3d& p : mesh.positions_mm) p = position + scale * (rotation * (p - origin));
    for (Eigen::Vector3d& n : mesh.normals) n = rotation * n;
    mesh.motion_mm = object.vector("motion_mm", {0, 0, 0});
  }
}

std::vector<MeshObject> read_meshes(const Object& object, const std::filesystem::path& folder,
                                    std::vector<std::filesystem::path>& files) {
  std::vector<MeshObject> objects = read_model(folder / object.text("file"), &files);
  for (MeshObject& mesh : objects) {
    read_material(object, mesh.material);
    if (object.has("picture")) {
      if (mesh.texture_coordinates.empty())
        throw object.fault("picture", "the model has no texture coordinates");
      files.push_back(folder / object.text("picture"));
      mesh.material.texture = read_picture(files.back());
    }
  }
  place(objects, object);
  check_distance(object, "position_mm", distance_mm(objects));
  return objects;
}

std::vector<TexturedPlane> read_panorama(const Json& json, const std::string& where,
                                         const std::filesystem::path& folder,
                                         std::vector<std::filesystem::path>& files) {
  const Object object(json, where, {"type", "picture"});
  files.push_back(folder / object.text("picture"));
  const std::shared_ptr<const Texture> picture = read_picture(files.back());
  if (picture->width != 2 * picture->height)
    throw object.fault("picture", "an equirectangular picture is twice as wide as high, this one is " +
                                      std::to_string(picture->width) + " x " +
                                      std::to_string(picture->height));
  return panorama(*picture);
}

void read_object(const Json& json, const std::string& where, const std::filesystem::path& folder,
                 Scene& scene) {
  const bool is_mesh = json.is_object() && json.value("type", Json()) == Json("mesh");
  const Object object(
      json, where,
      is_mesh ? with_material({"type", "file", "position_mm", "rotate_deg", "scale", "size_mm", "picture"})
              : with_material({"type", "centre_mm", "right_mm", "up_mm", "at_infinity", "picture", "chart",
                               "radiance", "wavelengths_nm", "lit"}));
  if (is_mesh) {
    for (MeshObject& mesh : read_meshes(object, folder, scene.files)) scene.meshes.push_back(std::move(mesh));
    return;
  }
  if (object.text("type") != "plane")
    throw object.fault("type", "only \"plane\", \"mesh\" and \"panorama\" are known");
  TexturedPlane plane = read_plane(object, folder, scene.files);
  if (object.flag("lit")) {
    scene.meshes.push_back(lit(plane, object));
    return;
  }
  for (const char* key : {"colour", "reflectance", "specular", "shininess"})
    if (object.has(key))
      throw object.fault(key, "needs \"lit\": true; a plane that is not lit shows its picture as it is");
  scene.planes.push_back(std::move(plane));
}

Light read_light(const Json& json, const std::string& where) {
  constexpr double brightest = 1000;
  const Json type = json.is_object() ? json.value("type", Json()) : Json();
  const bool point = type == Json("point");
  if (type.is_string() && !point && type != Json("directional"))
    throw input_error(where + ": type: only \"point\" and \"directional\" are known");
  const Object object(json, where,
                      point
                          ? std::set<std::string>{"type", "position_mm", "colour", "radiance", "reference_mm"}
                          : std::set<std::string>{"type", "direction", "colour", "radiance"});
  Light light;
  if (object.has("colour") && object.has("radiance")) throw object.fault("radiance", "excludes \"colour\"");
  light.colour = object.light("colour", light.colour, brightest);
  light.radiance = object.spectrum("radiance", 1e6);
  if (point) {
    light.at = object.vector("position_mm");
    if (!object.has("reference_mm")) throw object.fault("reference_mm", "a distance is needed");
    light.reference_mm = object.positive("reference_mm", 1);
    return light;
  }
  if (type != Json("directional")) throw object.fault("type", "\"point\" or \"directional\" is needed");
  light.directional = true;
  light.at = -object.vector("direction");
  if (!(light.at.norm() > 0)) throw object.fault("direction", "must not be zero");
  light.at.normalize();
  return light;
}

/// Lights whose spectra are known: the brightest of them shows a white surface as the display's white.
void colour_spectral_lights(std::vector<Light>& lights) {
  double brightest = 0;
  for (Light& light : lights) {
    if (!light.radiance) continue;
    light.colour = colour_of_light(*light.radiance);
    brightest = std::max(brightest, light.colour.maxCoeff());
  }
  for (Light& light : lights)
    if (light.radiance && brightest > 0) light.colour /= brightest;
}

}  // namespace

Scene read_scene(const std::filesystem::path& file) {
  const Json json = read_json(file);
  const Object top(json, file.string(), {"name", "background", "objects", "lights", "ambient"});
  const auto list = [&](const char* key) -> const Json& {
    if (!json[key].is_array() || json[key].empty()) throw top.fault(key, "a list of at least one is needed");
    return json[key];
  };
  const auto entry = [&](const char* key, std::size_t i) {
    return file.string() + ": " + key + "[" + std::to_string(i) + "]";
  };
  Scene scene;
  scene.name = top.has("name") ? top.text("name") : file.stem().string();
  scene.background = top.light("background", scene.background, 1);
  if (!top.has("objects")) throw top.fault("objects", "a list of at least one is needed");
  std::vector<TexturedPlane> behind;
  for (std::size_t i = 0; i < list("objects").size(); ++i) {
    const Json& object = json["objects"][i];
    if (object.is_object() && object.value("type", Json()) == Json("panorama")) {
      for (TexturedPlane& face : read_panorama(object, entry("objects", i), file.parent_path(), scene.files))
        behind.push_back(std::move(face));
    } else {
      read_object(object, entry("objects", i), file.parent_path(), scene);
    }
  }
  // Of what lies at infinity the first in order is seen.
  std::move(behind.begin(), behind.end(), std::back_inserter(scene.planes));
  for (const char* key : {"lights", "ambient"})
    if (top.has(key) && scene.meshes.empty())
      throw top.fault(key, "nothing answers it: a mesh is needed, or \"lit\": true in a plane");
  if (top.has("lights"))
    for (std::size_t i = 0; i < list("lights").size(); ++i)
      scene.lights.push_back(read_light(json["lights"][i], entry("lights", i)));
  colour_spectral_lights(scene.lights);
  constexpr double shade = 0.1;  // what a surface in shadow shows where lights are given
  scene.ambient = top.light("ambient", Eigen::Vector3d::Constant(scene.lights.empty() ? 1 : shade), 1);
  return scene;
}

}  // namespace emmetrope::raytrace
