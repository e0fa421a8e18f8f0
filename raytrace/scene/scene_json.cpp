#include "raytrace/scene/scene_json.hpp"

#include <opencv2/imgcodecs.hpp>

#include <Eigen/Geometry>
#include <cmath>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/json.hpp"
#include "raytrace/scene/chart.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int largest_picture = 16384;

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
  bool flag(const char* key) const {
    if (!has(key)) return false;
    if (!json_[key].is_boolean()) throw fault(key, "true or false is needed");
    return json_[key].get<bool>();
  }
  Error fault(const std::string& key, const std::string& what) const {
    return input_error(place_ + ": key \"" + key + "\": " + what);
  }

 private:
  const Json& json_;
  std::string place_;
};

float decoded(unsigned char value) {
  const double v = value / 255.0;
  return static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
}

std::shared_ptr<const Texture> read_picture(const std::filesystem::path& file) {
  const std::string bytes = read_file(file);
  const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  const cv::Mat picture = bytes.empty() ? cv::Mat() : cv::imdecode(raw, cv::IMREAD_COLOR);
  if (picture.empty())
    throw input_error(file.string() + " is no picture that can be read", "use PNG, JPEG or TIFF");
  if (picture.cols > largest_picture || picture.rows > largest_picture || picture.cols < 2 ||
      picture.rows < 2)
    throw input_error(file.string() + " has " + std::to_string(picture.cols) + " x " +
                          std::to_string(picture.rows) + " pixels",
                      "use 2 to 16384 pixels a side");
  Texture texture;
  texture.width = picture.cols;
  texture.height = picture.rows;
  texture.channels = 3;
  for (int row = 0; row < picture.rows; ++row)
    for (int column = 0; column < picture.cols; ++column)
      for (int c = 0; c < 3; ++c)
        texture.values.push_back(decoded(picture.ptr<unsigned char>(row)[3 * column + 2 - c]));
  return std::make_shared<const Texture>(std::move(texture));
}

TexturedPlane read_plane(const Json& json, const std::string& place, const std::filesystem::path& folder) {
  const Object object(json, place,
                      {"type", "centre_mm", "right_mm", "up_mm", "at_infinity", "picture", "chart"});
  if (object.text("type") != "plane") throw object.fault("type", "only \"plane\" is known");
  if (object.has("picture") == object.has("chart"))
    throw input_error(place + ": one of the keys \"picture\" and \"chart\" is needed");
  TexturedPlane plane;
  plane.at_infinity = object.flag("at_infinity");
  plane.centre_mm = object.vector("centre_mm");
  plane.right_mm = object.vector("right_mm");
  plane.up_mm = object.vector("up_mm");
  if (!(plane.right_mm.cross(plane.up_mm).norm() > 0))
    throw object.fault("up_mm", "right_mm and up_mm span no plane");
  if (object.has("picture")) {
    plane.texture = read_picture(folder / object.text("picture"));
  } else {
    // Drawn for the angle under which the plane is seen from the apex; its place is the plane's.
    ChartSpec chart = parse_chart(object.text("chart"));
    const double distance = plane.at_infinity ? plane.centre_mm.z() : plane.centre_mm.norm();
    chart.distance_mm = std::max(20.0, distance);
    chart.extent_deg = 2 * std::atan2(std::max(plane.right_mm.norm(), plane.up_mm.norm()), distance) / degree;
    plane.texture = draw_chart(chart).planes.front().texture;
  }
  return plane;
}

}  // namespace

Scene read_scene(const std::filesystem::path& file) {
  const Json json = read_json(file);
  const Object top(json, file.string(), {"name", "background", "objects"});
  Scene scene;
  scene.name = top.has("name") ? top.text("name") : file.stem().string();
  if (top.has("background")) scene.background = top.vector("background");
  if ((scene.background.array() < 0).any() || (scene.background.array() > 1).any())
    throw top.fault("background", "linear light from 0 to 1 is needed");
  if (!top.has("objects") || !json["objects"].is_array() || json["objects"].empty())
    throw top.fault("objects", "a list of at least one object is needed");
  for (std::size_t i = 0; i < json["objects"].size(); ++i)
    scene.planes.push_back(read_plane(
        json["objects"][i], file.string() + ": objects[" + std::to_string(i) + "]", file.parent_path()));
  return scene;
}

}  // namespace emmetrope::raytrace
