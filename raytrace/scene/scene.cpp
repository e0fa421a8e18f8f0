#include "raytrace/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/scene/chart.hpp"
#include "raytrace/scene/panorama.hpp"
#include "raytrace/scene/scene_json.hpp"

namespace emmetrope::raytrace {
namespace {

/// Four letter charts side by side at 250, 500, 1000 and 4000 mm, each 8 degrees wide: what is near and far
/// at once.
Scene cards() {
  Scene scene;
  scene.name = "cards";
  scene.background = Eigen::Vector3d::Constant(0.6);
  const std::array<double, 4> distances_mm{250, 500, 1000, 4000};
  for (std::size_t i = 0; i < distances_mm.size(); ++i) {
    ChartSpec spec;
    spec.distance_mm = distances_mm[i];
    spec.logmar = 1.1;
    spec.logmar_given = true;
    spec.extent_deg = 8;
    TexturedPlane card = draw_chart(spec).planes.front();
    const double offset = 0.0787 * distances_mm[i];  // 4.5 degrees
    card.centre_mm.x() = i % 2 == 0 ? offset : -offset;
    card.centre_mm.y() = i < 2 ? offset : -offset;
    scene.planes.push_back(std::move(card));
  }
  return scene;
}

/// A texture of `n` x `n` squares, white and `colour`.
std::shared_ptr<const Texture> checks(int n, const Eigen::Vector3d& colour) {
  constexpr int texels = 16;  // a square
  Texture texture{n * texels, n * texels, 3, {}};
  for (int row = 0; row < texture.height; ++row)
    for (int column = 0; column < texture.width; ++column)
      for (int c = 0; c < 3; ++c)
        texture.values.push_back((row / texels + column / texels) % 2 == 0 ? 1.F
                                                                           : static_cast<float>(colour[c]));
  return std::make_shared<const Texture>(std::move(texture));
}

/// A square pyramid whose apex points to the patient.
MeshObject pyramid(const Eigen::Vector3d& apex_mm, double half_mm, const Eigen::Vector3d& colour) {
  MeshObject mesh;
  mesh.material.texture = checks(8, colour);
  const double depth_mm = 1.2 * half_mm;
  for (int side = 0; side < 4; ++side) {
    const auto corner = [&](int k) {
      const double angle = (45 + 90 * k) * degree;
      return Eigen::Vector3d(apex_mm + Eigen::Vector3d(std::sqrt(2.0) * half_mm * std::cos(angle),
                                                       std::sqrt(2.0) * half_mm * std::sin(angle), depth_mm));
    };
    const int first = static_cast<int>(mesh.positions_mm.size());
    const Eigen::Vector3d a = corner(side), b = corner(side + 1);
    Eigen::Vector3d normal = (a - apex_mm).cross(b - apex_mm).normalized();
    if (normal.z() > 0) normal = -normal;
    mesh.positions_mm.insert(mesh.positions_mm.end(), {apex_mm, a, b});
    mesh.normals.insert(mesh.normals.end(), 3, normal);
    mesh.texture_coordinates.insert(mesh.texture_coordinates.end(), {{0.5, 1}, {0, 0}, {1, 0}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Three textured pyramids, apices towards the patient: the nearest straight ahead at 200 mm, the second to
/// the right at 350 mm, the third to the left at 600 mm; light from above left.
Scene pyramids() {
  Scene scene;
  scene.name = "pyramids";
  scene.background = Eigen::Vector3d::Constant(0.6);
  scene.meshes = {pyramid({0, 0, 200}, 12, {0.7, 0.1, 0.05}), pyramid({-45, 8, 350}, 21, {0.05, 0.4, 0.1}),
                  pyramid({75, -5, 600}, 36, {0.05, 0.15, 0.6})};
  scene.lights = {Light{true, Eigen::Vector3d(0.5, 0.8, -1).normalized(), Eigen::Vector3d::Constant(0.8), 0}};
  scene.ambient = Eigen::Vector3d::Constant(0.3);
  return scene;
}

}  // namespace

Scene at_time(const Scene& scene, double time) {
  Scene result = scene;
  for (TexturedPlane& plane : result.planes) plane.centre_mm += time * plane.motion_mm;
  for (MeshObject& mesh : result.meshes)
    for (Eigen::Vector3d& position : mesh.positions_mm) position += time * mesh.motion_mm;
  return result;
}

bool moves(const Scene& scene) {
  const auto moving = [](const auto& object) { return !object.motion_mm.isZero(0); };
  return std::any_of(scene.planes.begin(), scene.planes.end(), moving) ||
         std::any_of(scene.meshes.begin(), scene.meshes.end(), moving);
}

std::shared_ptr<const Scene> make_scene(const std::string& name_or_file) {
  const std::filesystem::path path = name_or_file;
  if (path.extension() == ".json") return std::make_shared<const Scene>(read_scene(path));
  if (name_or_file == "pyramids") return std::make_shared<const Scene>(pyramids());
  if (name_or_file == "cards") return std::make_shared<const Scene>(cards());
  if (name_or_file == "perimeter") return std::make_shared<const Scene>(perimeter());
  for (const std::string name : {"pyramids", "cards", "perimeter"})
    if (name_or_file.rfind(name + ":", 0) == 0)
      throw usage_error(fmt::format("{} takes no keys, found \"{}\"", name, name_or_file),
                        fmt::format("write {}, or describe a scene of your own in a scene.json", name));
  return std::make_shared<const Scene>(draw_chart(parse_chart(name_or_file)));
}

}  // namespace emmetrope::raytrace
