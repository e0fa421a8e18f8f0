#include "raytrace/device/device_meshes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "raytrace/system/box_hierarchy.hpp"
#include "raytrace/system/int_bits.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int triangle_floats = 16, attribute_floats = 32, material_floats = 12;

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

/// Fills the tables part by part.
class MeshTables {
 public:
  MeshTables(const Scene& scene, const Eigen::Isometry3d& eye_from_scene, int channels)
      : scene_(scene), eye_from_scene_(eye_from_scene), channels_(channels) {}

  void add_materials(const std::function<std::size_t(const Texture&)>& first_texel_of) {
    std::map<const Texture*, std::size_t> first_texels;
    const auto white = std::make_shared<const Texture>(Texture{2, 2, 1, {1, 1, 1, 1}});
    for (std::size_t m = 0; m < scene_.meshes.size(); ++m) {
      const MeshObject& mesh = scene_.meshes[m];
      const Material& material = mesh.material;
      const Texture* texture =
          material.texture && !mesh.texture_coordinates.empty() ? material.texture.get() : white.get();
      if (first_texels.count(texture) == 0) first_texels[texture] = first_texel_of(*texture);
      push(result.materials, shown(material.colour));
      for (const double value : {material.specular, material.shininess, static_cast<double>(texture->width),
                                 static_cast<double>(texture->height)})
        result.materials.push_back(static_cast<float>(value));
      result.materials.push_back(int_bits(texture->width));
      result.materials.push_back(int_bits(first_texels[texture]));
      result.materials.resize((m + 1) * material_floats);
    }
  }

  void add_triangles() {
    const std::vector<Triangle> triangles = triangles_in_eye();
    std::vector<std::array<Eigen::Vector3d, 3>> all_corners;
    for (const Triangle& triangle : triangles) all_corners.push_back(triangle.corners);
    BoxHierarchy hierarchy = make_box_hierarchy(all_corners);
    result.node_count = hierarchy.node_count();
    result.nodes = std::move(hierarchy.nodes);
    for (const int place : hierarchy.order) {
      append_geometry(result.triangles, triangles[place]);
      append_attributes(triangles[place]);
    }
  }

  void add_lights() {
    push(result.lights, shown(scene_.ambient));
    result.lights.push_back(0);
    for (const Light& light : scene_.lights) {
      push(result.lights, light.directional ? Eigen::Vector3d(eye_from_scene_.linear() * light.at)
                                            : Eigen::Vector3d(eye_from_scene_ * light.at));
      result.lights.push_back(
          light.directional ? 0.F : static_cast<float>(light.reference_mm * light.reference_mm));
      push(result.lights, shown(light.colour));
      result.lights.push_back(0);
    }
    result.light_count = static_cast<int>(scene_.lights.size());
  }

  DeviceMeshes result;

 private:
  Eigen::Vector3d shown(const Eigen::Vector3d& rgb) const { return channels_ == 1 ? luminance(rgb) : rgb; }
  template <typename Values>
  static void push(std::vector<float>& out, const Values& values) {
    for (Eigen::Index c = 0; c < values.size(); ++c) out.push_back(static_cast<float>(values[c]));
  }

  std::vector<Triangle> triangles_in_eye() const {
    std::vector<Triangle> triangles;
    for (std::size_t m = 0; m < scene_.meshes.size(); ++m) {
      const MeshObject& mesh = scene_.meshes[m];
      for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
        const auto& t = mesh.triangles[k];
        triangles.push_back(
            {static_cast<int>(m),
             static_cast<int>(k),
             {eye_from_scene_ * mesh.positions_mm[t[0]], eye_from_scene_ * mesh.positions_mm[t[1]],
              eye_from_scene_ * mesh.positions_mm[t[2]]}});
      }
    }
    return triangles;
  }

  void append_attributes(const Triangle& triangle) {
    const MeshObject& mesh = scene_.meshes[triangle.mesh];
    const auto& corners = mesh.triangles[triangle.index];
    for (const int i : corners)
      push(result.attributes, Eigen::Vector3d(eye_from_scene_.linear() * mesh.normals[i]));
    for (const int i : corners)
      push(result.attributes, mesh.colours.empty() ? Eigen::Vector3d(1, 1, 1) : shown(mesh.colours[i]));
    for (const int i : corners)
      push(result.attributes,
           mesh.texture_coordinates.empty() ? Eigen::Vector2d(0, 0) : mesh.texture_coordinates[i]);
    result.attributes.push_back(int_bits(triangle.mesh));
    result.attributes.resize(result.triangles.size() / triangle_floats * attribute_floats);
  }

  const Scene& scene_;
  const Eigen::Isometry3d& eye_from_scene_;
  int channels_;
};

}  // namespace

DeviceMeshes make_device_meshes(const Scene& scene, const Eigen::Isometry3d& eye_from_scene, int channels,
                                const std::function<std::size_t(const Texture&)>& first_texel_of) {
  MeshTables tables(scene, eye_from_scene, channels);
  tables.add_materials(first_texel_of);
  tables.add_triangles();
  tables.add_lights();
  return std::move(tables.result);
}

}  // namespace emmetrope::raytrace
