#include "pipeline/eye/model/clean_sheet.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"

namespace emmetrope {
namespace {

/// A side of a triangle, from the smaller vertex number to the larger.
struct TriangleSide {
  int low = 0, high = 0, triangle = 0;
  bool runs_down = false;  ///< the triangle goes from the larger to the smaller
};

/// Those of one edge side by side.
std::vector<TriangleSide> sides_by_edge(const TriangleMesh& mesh) {
  std::vector<TriangleSide> sides;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const int a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), static_cast<int>(t), a > b});
    }
  std::sort(sides.begin(), sides.end(), [](const TriangleSide& a, const TriangleSide& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  return sides;
}

/// \param visit  called with the first and the end of the sides of every edge
template <typename Visit>
void for_each_edge(const std::vector<TriangleSide>& sides, const Visit& visit) {
  for (auto first = sides.begin(); first != sides.end();) {
    const auto end = std::find_if(first, sides.end(), [&](const TriangleSide& side) {
      return side.low != first->low || side.high != first->high;
    });
    visit(first, end);
    first = end;
  }
}

void wind_alike(TriangleMesh& mesh, const std::vector<TriangleSide>& sides) {
  struct Neighbour {
    int triangle = 0;
    bool is_against = false;
  };
  std::vector<std::vector<Neighbour>> neighbours(mesh.triangles.size());
  for_each_edge(sides, [&](auto first, auto end) {
    if (end - first != 2) return;
    const auto second = first + 1;
    const bool is_against = first->runs_down == second->runs_down;
    neighbours[first->triangle].push_back({second->triangle, is_against});
    neighbours[second->triangle].push_back({first->triangle, is_against});
  });
  enum Side : char { unseen, kept, turned };
  std::vector<Side> side_of(mesh.triangles.size(), unseen);
  for (std::size_t start = 0; start < side_of.size(); ++start) {
    if (side_of[start] != unseen) continue;
    side_of[start] = kept;
    std::vector<int> part{static_cast<int>(start)};
    for (std::size_t i = 0; i < part.size(); ++i)
      for (const Neighbour& next : neighbours[part[i]]) {
        const Side wanted = next.is_against == (side_of[part[i]] == kept) ? turned : kept;
        if (side_of[next.triangle] == unseen) {
          side_of[next.triangle] = wanted;
          part.push_back(next.triangle);
        } else if (side_of[next.triangle] != wanted) {
          throw input_error(
              "the mesh is a one-sided sheet: its triangles cannot be wound alike",
              "an optical surface is one sheet with two sides; check it where parts were joined");
        }
      }
    const auto is_turned = [&](int triangle) { return side_of[triangle] == turned; };
    const auto turned_ones = std::count_if(part.begin(), part.end(), is_turned);
    const Side fewer = 2 * turned_ones > static_cast<std::ptrdiff_t>(part.size()) ? kept : turned;
    for (const int triangle : part)
      if (side_of[triangle] == fewer) std::swap(mesh.triangles[triangle][1], mesh.triangles[triangle][2]);
  }
}

/// How far normals lean from the triangles' own, within the rim.
struct NormalsLean {
  double largest_deg = 0, mean_deg = 0;
};

NormalsLean lean_of_normals(const TriangleMesh& mesh, const std::vector<TriangleSide>& sides) {
  TriangleMesh own = mesh;
  estimate_normals(own);
  std::vector<bool> is_at_rim(mesh.vertices.size(), false);
  for_each_edge(sides, [&](auto first, auto end) {
    if (end - first == 1) is_at_rim[first->low] = is_at_rim[first->high] = true;
  });
  double alike = 0;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) alike += mesh.normals[i].dot(own.normals[i]);
  NormalsLean lean;
  int count = 0;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (is_at_rim[i]) continue;
    const Eigen::Vector3d normal = alike < 0 ? Eigen::Vector3d(-own.normals[i]) : own.normals[i];
    const double deg = std::atan2(normal.cross(mesh.normals[i]).norm(), normal.dot(mesh.normals[i])) / degree;
    lean.largest_deg = std::max(lean.largest_deg, deg);
    lean.mean_deg += (deg - lean.mean_deg) / ++count;
  }
  return lean;
}

}  // namespace

std::vector<std::string> clean_sheet(MeshFile& file) {
  TriangleMesh& mesh = file.mesh;
  file.has_face_normals |= weld(mesh);
  if (mesh.triangles.empty())
    throw input_error("the mesh has no triangles", "an optical surface is a sheet of them; points do not do");
  std::vector<std::string> not_used;
  if (file.has_face_normals)
    not_used.emplace_back(
        "the file has normals of faces, several at one place: those of a smooth surface are "
        "estimated instead");
  const std::vector<TriangleSide> sides = sides_by_edge(mesh);
  wind_alike(mesh, sides);
  if (mesh.normals.empty()) return not_used;
  constexpr double most_deg = 20, most_mean_deg = 5;
  const NormalsLean lean = lean_of_normals(mesh, sides);
  if (lean.largest_deg > most_deg || lean.mean_deg > most_mean_deg) {
    mesh.normals.clear();
    not_used.push_back(
        fmt::format("the file's normals lean up to {:.0f} degrees from its triangles, {:.0f} on the "
                    "average: those of the triangles are used instead",
                    lean.largest_deg, lean.mean_deg));
  }
  return not_used;
}

}  // namespace emmetrope
