#include "raytrace/tracer/triangle_walk.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace emmetrope::raytrace {
namespace {

constexpr int floats_a_triangle = 32;
constexpr double cells_a_triangle = 8;

float bits(int value) {
  float result = 0;
  std::memcpy(&result, &value, sizeof result);
  return result;
}

/// Triangles turned so that their normals have positive z.
std::vector<std::array<int, 3>> outward(const TriangleMesh& mesh) {
  auto triangles = mesh.triangles;
  for (auto& t : triangles) {
    const Eigen::Vector3d normal =
        (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    if (normal.z() < 0) std::swap(t[1], t[2]);
  }
  return triangles;
}

/// For a grid of `size` x `size` cells over [-reach, reach]^2: the triangle nearest to each cell's centre, as
/// far as boxes tell, and spread over cells that no triangle covers.
std::vector<int> seed_grid(const TriangleMesh& mesh, const std::vector<std::array<int, 3>>& triangles,
                           int size, double reach) {
  std::vector<int> seed(static_cast<std::size_t>(size) * size, -1);
  std::vector<double> distance(seed.size(), 1e30);
  const double cell = 2 * reach / size;
  const auto cell_of = [&](double x) {
    return std::clamp(static_cast<int>((x + reach) / cell), 0, size - 1);
  };
  for (std::size_t f = 0; f < triangles.size(); ++f) {
    Eigen::Vector2d low(1e30, 1e30), high(-1e30, -1e30), centre(0, 0);
    for (const int vertex : triangles[f]) {
      const Eigen::Vector2d p = mesh.vertices[vertex].head<2>();
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
      centre += p / 3;
    }
    for (int j = cell_of(low.y()); j <= cell_of(high.y()); ++j)
      for (int i = cell_of(low.x()); i <= cell_of(high.x()); ++i) {
        const Eigen::Vector2d at((i + 0.5) * cell - reach, (j + 0.5) * cell - reach);
        const double d = (at - centre).squaredNorm();
        const std::size_t k = static_cast<std::size_t>(j) * size + i;
        if (d < distance[k]) {
          distance[k] = d;
          seed[k] = static_cast<int>(f);
        }
      }
  }
  // Cells outside the sheet take a neighbour's triangle, ring after ring.
  std::vector<std::size_t> front;
  for (std::size_t k = 0; k < seed.size(); ++k)
    if (seed[k] >= 0) front.push_back(k);
  while (!front.empty()) {
    std::vector<std::size_t> next;
    for (const std::size_t k : front) {
      const int i = static_cast<int>(k % size), j = static_cast<int>(k / size);
      for (const auto& [di, dj] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        if (i + di < 0 || i + di >= size || j + dj < 0 || j + dj >= size) continue;
        const std::size_t n = static_cast<std::size_t>(j + dj) * size + i + di;
        if (seed[n] < 0) {
          seed[n] = seed[k];
          next.push_back(n);
        }
      }
    }
    front.swap(next);
  }
  return seed;
}

}  // namespace

DeviceSurface triangle_walk(const TriangleMesh& mesh, const BaseConic& base) {
  const auto triangles = outward(mesh);
  // The triangles that leave each vertex along an edge: first[v] ... first[v + 1] of `leaving`.
  struct Edge {
    int to, triangle;
  };
  std::vector<int> first(mesh.vertices.size() + 1, 0);
  for (const auto& t : triangles)
    for (const int vertex : t) ++first[vertex + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<Edge> leaving(3 * triangles.size());
  std::vector<int> next(first.begin(), first.end() - 1);
  for (std::size_t f = 0; f < triangles.size(); ++f)
    for (int k = 0; k < 3; ++k)
      leaving[next[triangles[f][k]]++] = {triangles[f][(k + 1) % 3], static_cast<int>(f)};
  const auto neighbour = [&](int a, int b) {  // across the edge from a to b
    const auto begin = leaving.begin() + first[b], end = leaving.begin() + first[b + 1];
    const auto found = std::find_if(begin, end, [a](const Edge& edge) { return edge.to == a; });
    return bits(found != end ? found->triangle * floats_a_triangle : -1);
  };

  DeviceSurface form;
  form.kind = Operation::triangles;
  auto& records = form.records;
  records.reserve(triangles.size() * floats_a_triangle);
  double reach = 0;
  for (const auto& [a, b, c] : triangles) {
    const Eigen::Vector3d pa = mesh.vertices[a], u = mesh.vertices[b] - pa, v = mesh.vertices[c] - pa;
    const Eigen::Vector3d cross = u.cross(v), normal = cross.normalized();
    const double square = cross.squaredNorm();
    const Eigen::Vector3d gu = v.cross(cross) / square,
                          gv = cross.cross(u) / square;  // gradients of the coordinates
    const auto push = [&](const Eigen::Vector3d& g) {
      for (int k = 0; k < 3; ++k) records.push_back(static_cast<float>(g[k]));
    };
    push(normal);
    records.push_back(static_cast<float>(normal.dot(pa)));
    push(gu);
    records.push_back(static_cast<float>(-gu.dot(pa)));
    push(gv);
    records.push_back(static_cast<float>(-gv.dot(pa)));
    records.insert(records.end(), {neighbour(c, a), neighbour(a, b), neighbour(b, c), 0.F});
    push(mesh.normals[a]);
    push(mesh.normals[b]);
    push(mesh.normals[c]);
    records.insert(records.end(), 7, 0.F);
    for (const int vertex : {a, b, c})
      reach = std::max(reach, mesh.vertices[vertex].head<2>().cwiseAbs().maxCoeff());
  }

  const int size =
      std::max(8, static_cast<int>(std::sqrt(cells_a_triangle * static_cast<double>(triangles.size()))));
  form.columns = size;
  for (const int seed : seed_grid(mesh, triangles, size, reach))
    form.seeds.push_back(bits(seed * floats_a_triangle));
  form.parameters = {base.curvature_per_mm,
                     base.curvature_per_mm * (1 + base.q),
                     -reach,
                     -reach,
                     size / (2 * reach),
                     size - 0.001,
                     size - 0.001,
                     0,
                     0,
                     base.offset_mm};
  return form;
}

}  // namespace emmetrope::raytrace
