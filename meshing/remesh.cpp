#include "meshing/remesh.hpp"

#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/Euler_operations.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::Vector3d;
using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

Kernel::Point_3 to_cgal(const Vector3d& p) { return {p.x(), p.y(), p.z()}; }
Vector3d from_cgal(const Kernel::Point_3& p) { return {p.x(), p.y(), p.z()}; }

double ring_length_mm(const Sheet& sheet, double reach) {
  constexpr int steps = 90;
  double length = 0;
  for (int i = 0; i < steps; ++i)
    length += (sheet.at(reach, (i + 1) * 2 * pi / steps) - sheet.at(reach, i * 2 * pi / steps)).norm();
  return length;
}

double meridian_length_mm(const Sheet& sheet) {
  constexpr int steps = 60;
  double length = 0;
  for (int i = 0; i < steps; ++i)
    length += (sheet.at((i + 1.0) / steps, 0) - sheet.at(double(i) / steps, 0)).norm();
  return length;
}

double area_mm2(const Sheet& sheet) {
  constexpr int rings = 60;
  double area = 0;
  for (int i = 0; i < rings; ++i) area += ring_length_mm(sheet, (i + 0.5) / rings);
  return area * meridian_length_mm(sheet) / rings;
}

/// Concentric rings of equally spaced vertices, neighbouring rings joined by a zip of triangles.
Mesh ring_mesh(const Sheet& sheet, double edge_mm) {
  Mesh mesh;
  const int rings = std::max(2, static_cast<int>(std::lround(meridian_length_mm(sheet) / edge_mm)));
  std::vector<Mesh::Vertex_index> inner{mesh.add_vertex(to_cgal(sheet.at(0, 0)))};
  for (int ring = 1; ring <= rings; ++ring) {
    const double reach = static_cast<double>(ring) / rings;
    const int count = std::max(6, static_cast<int>(std::lround(ring_length_mm(sheet, reach) / edge_mm)));
    std::vector<Mesh::Vertex_index> outer;
    for (int i = 0; i < count; ++i)
      outer.push_back(mesh.add_vertex(to_cgal(sheet.at(reach, i * 2 * pi / count))));
    const std::size_t n = inner.size(), m = outer.size();
    for (std::size_t i = 0, j = 0; i < n || j < m;) {
      const bool step_outside = n == 1 || i == n || (j < m && (j + 1) * n <= (i + 1) * m);
      if (step_outside) {
        mesh.add_face(inner[i % n], outer[j % m], outer[(j + 1) % m]);
        ++j;
        if (n == 1 && j == m) break;
      } else {
        mesh.add_face(inner[i % n], outer[j % m], inner[(i + 1) % n]);
        ++i;
      }
    }
    inner = std::move(outer);
  }
  return mesh;
}

double edge_length2(const Mesh& mesh, Mesh::Edge_index e) {
  return CGAL::squared_distance(mesh.point(mesh.vertex(e, 0)), mesh.point(mesh.vertex(e, 1)));
}

bool touches_rim(const Mesh& mesh, Mesh::Edge_index e) {
  return mesh.is_border(mesh.vertex(e, 0), true) || mesh.is_border(mesh.vertex(e, 1), true);
}

Kernel::Point_3 midpoint_on(const Sheet& sheet, const Mesh& mesh, Mesh::Edge_index e) {
  return to_cgal(sheet.project(
      (from_cgal(mesh.point(mesh.vertex(e, 0))) + from_cgal(mesh.point(mesh.vertex(e, 1)))) / 2));
}

void split_longest_edge(Mesh& mesh, const Sheet& sheet) {
  Mesh::Edge_index longest;
  double length2 = 0;
  for (const auto e : mesh.edges()) {
    if (!mesh.is_border(e) && edge_length2(mesh, e) > length2) {
      longest = e;
      length2 = edge_length2(mesh, e);
    }
  }
  const auto point = midpoint_on(sheet, mesh, longest);
  const auto h = mesh.halfedge(longest);
  const auto fresh = CGAL::Euler::split_edge(h, mesh);  // ends in the new vertex, where h now begins
  mesh.point(mesh.target(fresh)) = point;
  CGAL::Euler::split_face(fresh, mesh.next(h), mesh);
  const auto back = mesh.opposite(h);
  CGAL::Euler::split_face(back, mesh.next(mesh.next(back)), mesh);
}

/// \return whether there was an edge to collapse
bool collapse_shortest_edge(Mesh& mesh, const Sheet& sheet) {
  std::vector<std::pair<double, Mesh::Edge_index>> edges;
  for (const auto e : mesh.edges()) {
    if (!touches_rim(mesh, e)) edges.emplace_back(edge_length2(mesh, e), e);
  }
  std::sort(edges.begin(), edges.end());
  for (const auto& [length2, e] : edges) {
    if (!CGAL::Euler::does_satisfy_link_condition(e, mesh)) continue;
    const auto point = midpoint_on(sheet, mesh, e);
    mesh.point(CGAL::Euler::collapse_edge(e, mesh)) = point;
    return true;
  }
  return false;
}

/// Angle at the vertex that the halfedge faces.
double opposite_angle(const Mesh& mesh, Mesh::Halfedge_index h) {
  const Vector3d apex = from_cgal(mesh.point(mesh.target(mesh.next(h))));
  const Vector3d a = from_cgal(mesh.point(mesh.source(h))) - apex;
  const Vector3d b = from_cgal(mesh.point(mesh.target(h))) - apex;
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Flips every inner edge whose opposite angles add up to more than 180 degrees, until there is none.
void make_delaunay(Mesh& mesh) {
  for (int pass = 0; pass < 20; ++pass) {
    bool flipped = false;
    for (const auto e : mesh.edges()) {
      if (mesh.is_border(e)) continue;
      const auto h = mesh.halfedge(e);
      const auto o = mesh.opposite(h);
      const auto a = mesh.target(mesh.next(h)), b = mesh.target(mesh.next(o));
      const bool exists = mesh.halfedge(a, b) != Mesh::null_halfedge();
      if (exists || opposite_angle(mesh, h) + opposite_angle(mesh, o) < pi + 1e-9) continue;
      CGAL::Euler::flip_edge(h, mesh);
      flipped = true;
    }
    if (!flipped) return;
  }
}

/// Moves every inner vertex to the middle of its neighbours, along the surface.
void relax(Mesh& mesh, const Sheet& sheet) {
  std::vector<std::pair<Mesh::Vertex_index, Vector3d>> moved;
  for (const auto v : mesh.vertices()) {
    if (mesh.is_border(v, true)) continue;
    Vector3d sum = Vector3d::Zero();
    for (const auto neighbour : mesh.vertices_around_target(mesh.halfedge(v)))
      sum += from_cgal(mesh.point(neighbour));
    moved.emplace_back(v, sheet.project(sum / mesh.degree(v)));
  }
  for (const auto& [v, point] : moved) mesh.point(v) = to_cgal(point);
}

void polish(Mesh& mesh, const Sheet& sheet) {
  for (int i = 0; i < 10; ++i) {
    make_delaunay(mesh);
    relax(mesh, sheet);
  }
  make_delaunay(mesh);
}

Mesh isotropic(const Sheet& sheet, double edge_mm) {
  Mesh mesh = ring_mesh(sheet, edge_mm);
  const auto on_sheet = [&](Mesh::Vertex_index v) {
    return to_cgal(sheet.project(from_cgal(mesh.point(v))));
  };
  CGAL::Polygon_mesh_processing::isotropic_remeshing(
      mesh.faces(), edge_mm, mesh,
      CGAL::parameters::number_of_iterations(5).protect_constraints(true).projection_functor(on_sheet));
  mesh.collect_garbage();
  return mesh;
}

TriangleMesh finished(Mesh mesh, const Sheet& sheet) {
  mesh.collect_garbage();
  TriangleMesh result;
  for (const auto v : mesh.vertices()) {
    result.vertices.push_back(from_cgal(mesh.point(v)));
    result.normals.push_back(sheet.normal(result.vertices.back()));
  }
  for (const auto f : mesh.faces()) {
    std::array<int, 3> triangle{};
    auto h = mesh.halfedge(f);
    for (int& corner : triangle) {
      corner = static_cast<int>(mesh.target(h).idx());
      h = mesh.next(h);
    }
    result.triangles.push_back(triangle);
  }
  return result;
}

}  // namespace

TriangleMesh mesh_with_edge(const Sheet& sheet, double edge_mm) {
  Mesh mesh = isotropic(sheet, edge_mm);
  polish(mesh, sheet);
  return finished(std::move(mesh), sheet);
}

TriangleMesh mesh_with_vertices(const Sheet& sheet, int vertices) {
  if (vertices < 60 || vertices > 200'000) {
    throw usage_error("a mesh of " + std::to_string(vertices) + " vertices was asked for",
                      "ask for 60 to 200 000 vertices a surface");
  }
  // Equilateral triangles: each vertex stands for an area of edge^2 sqrt(3)/2.
  double edge_mm = std::sqrt(area_mm2(sheet) / vertices * 2 / std::sqrt(3.0));
  const auto miss = [&](const Mesh& mesh) {
    return std::abs(static_cast<int>(mesh.number_of_vertices()) - vertices);
  };
  Mesh best = isotropic(sheet, edge_mm);
  double last = static_cast<double>(best.number_of_vertices());
  for (int attempt = 0; attempt < 8 && miss(best) > vertices / 100; ++attempt) {
    edge_mm *= std::sqrt(last / vertices);
    Mesh mesh = isotropic(sheet, edge_mm);
    last = static_cast<double>(mesh.number_of_vertices());
    if (miss(mesh) < miss(best)) best = std::move(mesh);
  }
  while (static_cast<int>(best.number_of_vertices()) < vertices) split_longest_edge(best, sheet);
  while (static_cast<int>(best.number_of_vertices()) > vertices && collapse_shortest_edge(best, sheet)) {
  }
  polish(best, sheet);
  return finished(std::move(best), sheet);
}

}  // namespace emmetrope::meshing
