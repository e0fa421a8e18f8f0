#include "raytrace/tracer/device_meshes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <numeric>

namespace emmetrope::raytrace {
namespace {

constexpr int node_floats = 8, triangle_floats = 16, attribute_floats = 32, material_floats = 12;
constexpr int leaf_size = 4, bins = 16;

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
  Eigen::Vector3d centre() const { return (corners[0] + corners[1] + corners[2]) / 3; }
  Eigen::AlignedBox3d box() const {
    Eigen::AlignedBox3d result;
    for (const auto& corner : corners) result.extend(corner);
    return result;
  }
};

double area(const Eigen::AlignedBox3d& box) {
  if (box.isEmpty()) return 0;
  const Eigen::Vector3d s = box.sizes();
  return s.x() * s.y() + s.y() * s.z() + s.z() * s.x();
}

/// Nodes in depth-first order, each with the number of the node that follows its whole branch: a walk needs
/// no stack.
class Hierarchy {
 public:
  Hierarchy(std::vector<Triangle>& triangles, std::vector<float>& nodes)
      : triangles_(triangles), nodes_(nodes) {
    if (!triangles.empty()) build(0, static_cast<int>(triangles.size()));
  }

 private:
  void build(int first, int count) {
    const std::size_t self = nodes_.size();
    nodes_.resize(self + node_floats);
    Eigen::AlignedBox3d box, centres;
    for (int k = first; k < first + count; ++k) {
      box.extend(triangles_[k].box());
      centres.extend(triangles_[k].centre());
    }
    // Room for float32: of the box's own corners and of where the ray is.
    const double room =
        2e-6 * (1 + std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()));
    const bool is_leaf = count <= leaf_size;
    if (!is_leaf) {
      const int left = split(first, count, centres);
      build(first, left);
      build(first + left, count - left);
    }
    for (int c = 0; c < 3; ++c) {
      nodes_[self + c] = static_cast<float>(box.min()[c] - room);
      nodes_[self + 4 + c] = static_cast<float>(box.max()[c] + room);
    }
    nodes_[self + 3] = bits(nodes_.size() / node_floats);
    nodes_[self + 7] = bits(is_leaf ? static_cast<std::size_t>(first) * 16 + count : 0);
  }

  /// Where the cost (area times triangles of both halves) is least among the bins' borders of the longest
  /// axis; the median where all centres coincide. Returns how many go left.
  int split(int first, int count, const Eigen::AlignedBox3d& centres) {
    int axis = 0;
    const double extent = centres.sizes().maxCoeff(&axis);
    const auto begin = triangles_.begin() + first, end = begin + count;
    const auto bin_of = [&](const Triangle& t) {
      return std::min(bins - 1, static_cast<int>(bins * (t.centre()[axis] - centres.min()[axis]) / extent));
    };
    if (!(extent > 0)) return count / 2;
    std::array<Eigen::AlignedBox3d, bins> boxes;
    std::array<int, bins> counts{};
    for (auto t = begin; t != end; ++t) {
      boxes[bin_of(*t)].extend(t->box());
      ++counts[bin_of(*t)];
    }
    std::array<double, bins> right_cost{};
    Eigen::AlignedBox3d right;
    int right_count = 0;
    for (int b = bins - 1; b > 0; --b) {
      right.extend(boxes[b]);
      right_cost[b] = area(right) * (right_count += counts[b]);
    }
    Eigen::AlignedBox3d left;
    int left_count = 0, best = 1;
    double least = std::numeric_limits<double>::infinity();
    for (int b = 1; b < bins; ++b) {
      left.extend(boxes[b - 1]);
      left_count += counts[b - 1];
      const double cost = area(left) * left_count + right_cost[b];
      if (left_count > 0 && left_count < count && cost < least) {
        least = cost;
        best = b;
      }
    }
    const auto middle =
        std::stable_partition(begin, end, [&](const Triangle& t) { return bin_of(t) < best; });
    return static_cast<int>(middle - begin);
  }

  std::vector<Triangle>& triangles_;
  std::vector<float>& nodes_;
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

  Hierarchy(triangles, result.nodes);
  result.node_count = static_cast<int>(result.nodes.size()) / node_floats;
  for (const Triangle& triangle : triangles) {
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
