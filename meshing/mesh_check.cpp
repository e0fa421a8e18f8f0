#include "meshing/mesh_check.hpp"

#include <fmt/format.h>

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::Vector3d;

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  using Normal = OpenMesh::Vec3d;
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;

constexpr double sliver_deg = 15;

Error broken(const std::string& what) {
  return {ExitStatus::fault, "a surface mesh is no clean sheet: " + what};
}

Mesh to_openmesh(const TriangleMesh& mesh) {
  Mesh result;
  std::vector<Mesh::VertexHandle> handles;
  for (const Vector3d& v : mesh.vertices) {
    if (!v.allFinite()) throw broken("a vertex is not finite");
    handles.push_back(result.add_vertex({v.x(), v.y(), v.z()}));
  }
  for (const auto& t : mesh.triangles) {
    const bool distinct = t[0] != t[1] && t[1] != t[2] && t[0] != t[2];
    // OpenMesh refuses a triangle that makes an edge complex or that runs against its neighbour.
    if (!distinct || !result.add_face(handles.at(t[0]), handles.at(t[1]), handles.at(t[2])).is_valid()) {
      throw broken(
          fmt::format("triangle ({}, {}, {}) is degenerate, non-manifold or turned over", t[0], t[1], t[2]));
    }
  }
  return result;
}

int count_boundary_loops(const Mesh& mesh) {
  std::vector<bool> seen(mesh.n_halfedges(), false);
  int loops = 0;
  for (const auto h : mesh.halfedges()) {
    if (!mesh.is_boundary(h) || seen[h.idx()]) continue;
    ++loops;
    for (auto walk = Mesh::HalfedgeHandle(h); !seen[walk.idx()]; walk = mesh.next_halfedge_handle(walk))
      seen[walk.idx()] = true;
  }
  return loops;
}

bool is_connected(const Mesh& mesh) {
  std::vector<bool> seen(mesh.n_vertices(), false);
  std::vector<Mesh::VertexHandle> open{mesh.vertex_handle(0)};
  seen[0] = true;
  std::size_t reached = 1;
  while (!open.empty()) {
    const auto v = open.back();
    open.pop_back();
    for (auto neighbour = mesh.cvv_iter(v); neighbour.is_valid(); ++neighbour) {
      if (seen[neighbour->idx()]) continue;
      seen[neighbour->idx()] = true;
      ++reached;
      open.push_back(*neighbour);
    }
  }
  return reached == mesh.n_vertices();
}

double angle_deg(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / degree;
}

}  // namespace

SheetQuality check_sheet(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) throw broken("it is empty");
  if (mesh.normals.size() != mesh.vertices.size()) throw broken("it has not one normal a vertex");
  const Mesh sheet = to_openmesh(mesh);
  for (const auto v : sheet.vertices()) {
    if (!sheet.is_manifold(v) || sheet.is_isolated(v))
      throw broken(fmt::format("vertex {} is not manifold", v.idx()));
  }
  if (!is_connected(sheet)) throw broken("it is in several parts");
  if (const int loops = count_boundary_loops(sheet); loops != 1)
    throw broken(fmt::format("it has {} boundary loops", loops));
  const auto euler =
      static_cast<long>(sheet.n_vertices() + sheet.n_faces()) - static_cast<long>(sheet.n_edges());
  if (euler != 1) throw broken(fmt::format("its Euler characteristic is {}, a disc's is 1", euler));

  SheetQuality quality;
  quality.vertices = static_cast<int>(sheet.n_vertices());
  quality.triangles = static_cast<int>(sheet.n_faces());
  for (const auto e : sheet.edges()) quality.mean_edge_mm += sheet.calc_edge_length(e) / sheet.n_edges();
  quality.smallest_angle_deg = 180;
  for (const auto& t : mesh.triangles) {
    const Vector3d &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    const Vector3d normal = (b - a).cross(c - a);
    for (const double angle : {angle_deg(b - a, c - a), angle_deg(c - b, a - b), angle_deg(a - c, b - c)})
      quality.smallest_angle_deg = std::min(quality.smallest_angle_deg, angle);
    for (const int corner : t)
      quality.largest_normal_deviation_deg =
          std::max(quality.largest_normal_deviation_deg, angle_deg(normal, mesh.normals[corner]));
  }
  if (quality.smallest_angle_deg < sliver_deg)
    throw broken(fmt::format("an angle of {:.1f} degrees makes a sliver", quality.smallest_angle_deg));
  if (quality.largest_normal_deviation_deg > 60)
    throw broken(fmt::format("a normal leans {:.0f} degrees against its triangle",
                             quality.largest_normal_deviation_deg));
  return quality;
}

Json to_json(const SheetQuality& quality) {
  return {{"vertices", quality.vertices},
          {"triangles", quality.triangles},
          {"mean_edge_mm", quality.mean_edge_mm},
          {"smallest_angle_deg", quality.smallest_angle_deg},
          {"largest_normal_deviation_deg", quality.largest_normal_deviation_deg}};
}

}  // namespace emmetrope::meshing
