#include "raytrace/device/device_meshes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>

#include "raytrace/system/box_hierarchy.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int triangle_floats = 16, attribute_floats = 32, material_floats = 12;

float bits(std::size_t value) {
  const auto integer = static_cast<std::int32_t>(value);
  float result = 0;
  std::memcpy(&result, &integer, sizeof result);
  return result;
}

/// A triangle of the whole scene: which mesh, which of its triangles, and its corners in the eye's frame.
struct Triangle {
  int mesh, index;
  std::array<Eigen::Vector3d, 3> corners;
};

/// Plane and barycentric forms; a triangle without area is never hit.
void append_geometry(std::vector<float>& out, const Triangle& triangle) {
  const auto& [p, q, s] = triangle.corners;
  const Eigen::Vector3d e = q - p, f = s - p, n = e.cross(f);
  const double square = n.squaredNorm();
  if (!(square > 0)) {
    out.insert(out.end(), triangle_floats, std::numeric_limits<float>::quiet_NaN());
    return;
  }
  const Eigen::Vector3d unit = n / std::sqrt(square), a = f.cross(n) / square, b = n.cross(e) / square;
  for (const auto& [form, constant] : {std::pair{unit, unit.dot(p)}, {a, -a.dot(p)}, {b, -b.dot(p)}}) {
    for (int c = 0; c < 3; ++c) out.push_back(static_cast<float>(form[c]));
    out.push_back(static_cast<float>(constant));
  }
  // What float32 may err by at this distance, so that no ray slips between neighbours.
  const double reach = std::max({p.cwiseAbs().maxCoeff(), q.cwiseAbs().maxCoeff(), s.cwiseAbs().maxCoeff()});
  out.push_back(static_cast<float>(1e-6 + 4e-7 * reach * std::max(a.norm(), b.norm())));
  out.insert(out.end(), 3, 0.F);
}

Eigen::Vector3d luminance(const Eigen::Vector3d& rgb) {
  return Eigen::Vector3d::Constant(rgb.dot(Eigen::Vector3d(0.2126, 0.7152, 0.0722)));
}

}  // namespace

DeviceMeshes make_device_meshes(const Scene& scene, const Eigen::Isometry3d& eye_from_scene, int channels,
                                const std::function<std::size_t(const Texture&)>& first_texel_of) {
  DeviceMeshes result;
  const auto shown = [&](const Eigen::Vector3d& rgb) { return channels == 1 ? luminance(rgb) : rgb; };
  const auto push = [](std::vector<float>& out, const auto& values) {
    for (Eigen::Index c = 0; c < values.size(); ++c) out.push_back(static_cast<float>(values[c]));
  };

  std::vector<Triangle> triangles;
  std::map<const Texture*, std::size_t> first_texels;
  const auto white = std::make_shared<const Texture>(Texture{2, 2, 1, {1, 1, 1, 1}});
  for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
    const MeshObject& mesh = scene.meshes[m];
    for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
      const auto& t = mesh.triangles[k];
      triangles.push_back(
          {static_cast<int>(m),
           static_cast<int>(k),
           {eye_from_scene * mesh.positions_mm[t[0]], eye_from_scene * mesh.positions_mm[t[1]],
            eye_from_scene * mesh.positions_mm[t[2]]}});
    }
    const Material& material = mesh.material;
    const Texture* texture =
        material.texture && !mesh.texture_coordinates.empty() ? material.texture.get() : white.get();
    if (first_texels.count(texture) == 0) first_texels[texture] = first_texel_of(*texture);
    push(result.materials, shown(material.colour));
    for (const double value : {material.specular, material.shininess, static_cast<double>(texture->width),
                               static_cast<double>(texture->height)})
      result.materials.push_back(static_cast<float>(value));
    result.materials.push_back(bits(texture->width));
    result.materials.push_back(bits(first_texels[texture]));
    result.materials.resize((m + 1) * material_floats);
  }

  std::vector<std::array<Eigen::Vector3d, 3>> all_corners;
  for (const Triangle& triangle : triangles) all_corners.push_back(triangle.corners);
  BoxHierarchy hierarchy = make_box_hierarchy(all_corners);
  result.node_count = hierarchy.node_count();
  result.nodes = std::move(hierarchy.nodes);
  for (const int place : hierarchy.order) {
    const Triangle& triangle = triangles[place];
    append_geometry(result.triangles, triangle);
    const MeshObject& mesh = scene.meshes[triangle.mesh];
    const auto& corners = mesh.triangles[triangle.index];
    for (const int i : corners)
      push(result.attributes, Eigen::Vector3d(eye_from_scene.linear() * mesh.normals[i]));
    for (const int i : corners)
      push(result.attributes, mesh.colours.empty() ? Eigen::Vector3d(1, 1, 1) : shown(mesh.colours[i]));
    for (const int i : corners)
      push(result.attributes,
           mesh.texture_coordinates.empty() ? Eigen::Vector2d(0, 0) : mesh.texture_coordinates[i]);
    result.attributes.push_back(bits(triangle.mesh));
    result.attributes.resize(result.triangles.size() / triangle_floats * attribute_floats);
  }

  push(result.lights, shown(scene.ambient));
  result.lights.push_back(0);
  for (const Light& light : scene.lights) {
    push(result.lights, light.directional ? Eigen::Vector3d(eye_from_scene.linear() * light.at)
                                          : Eigen::Vector3d(eye_from_scene * light.at));
    result.lights.push_back(light.directional ? 0.F
                                              : static_cast<float>(light.reference_mm * light.reference_mm));
    push(result.lights, shown(light.colour));
    result.lights.push_back(0);
  }
  result.light_count = static_cast<int>(scene.lights.size());
  return result;
}

}  // namespace emmetrope::raytrace
