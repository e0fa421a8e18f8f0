#include "raytrace/system/triangle_walk.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "raytrace/system/int_bits.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int floats_a_triangle = 16;
constexpr double cells_a_triangle = 2;
/// Triangles steeper than 84 degrees, at a lens's equator say, have no depth over x and y to speak of: the
/// sheet ends there.
constexpr double least_normal_z = 0.1;
constexpr double least_gradient = 0.05;  // LEAST_GRADIENT in kernels/surfaces.cl

Eigen::Vector3d cross_of(const TriangleMesh& mesh, const std::array<int, 3>& t) {
  return (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
}

/// Place on a Z curve over 1024 x 1024 cells: bits of i and j in turn.
std::uint32_t on_curve(std::uint32_t i, std::uint32_t j) {
  const auto spread = [](std::uint32_t v) {
    v = (v | v << 8U) & 0x00ff00ffU;
    v = (v | v << 4U) & 0x0f0f0f0fU;
    v = (v | v << 2U) & 0x33333333U;
    return (v | v << 1U) & 0x55555555U;
  };
  return spread(i) | spread(j) << 1U;
}

/// Triangles that are not too steep, turned so that their normals have positive z, neighbours close together
/// in memory.
std::vector<std::array<int, 3>> ordered(const TriangleMesh& mesh, double reach) {
  std::vector<std::pair<std::uint32_t, int>> places;
  places.reserve(mesh.triangles.size());
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    const auto& t = mesh.triangles[f];
    const Eigen::Vector3d cross = cross_of(mesh, t);
    if (!(std::abs(cross.z()) > least_normal_z * cross.norm())) continue;
    const Eigen::Vector2d centre =
        (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]).head<2>() / 3;
    const auto cell = [&](double x) { return static_cast<std::uint32_t>((x / reach + 1) * 511.9); };
    places.emplace_back(on_curve(cell(centre.x()), cell(centre.y())), static_cast<int>(f));
  }
  std::sort(places.begin(), places.end());
  std::vector<std::array<int, 3>> triangles;
  triangles.reserve(places.size());
  for (const auto& place : places) {
    auto t = mesh.triangles[place.second];
    if (cross_of(mesh, t).z() < 0) std::swap(t[1], t[2]);
    triangles.push_back(t);
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

/// Which triangle lies across an edge.
class Neighbours {
 public:
  Neighbours(const std::vector<std::array<int, 3>>& triangles, std::size_t vertices)
      : first_(vertices + 1, 0), leaving_(3 * triangles.size()) {
    for (const auto& t : triangles)
      for (const int vertex : t) ++first_[vertex + 1];
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<int> next(first_.begin(), first_.end() - 1);
    for (std::size_t f = 0; f < triangles.size(); ++f)
      for (int k = 0; k < 3; ++k)
        leaving_[next[triangles[f][k]]++] = {triangles[f][(k + 1) % 3], static_cast<int>(f)};
  }
  /// Of the triangle with the edge from a to b; -1: none.
  int across(int a, int b) const {
    const auto begin = leaving_.begin() + first_[b], end = leaving_.begin() + first_[b + 1];
    const auto found = std::find_if(begin, end, [a](const Edge& edge) { return edge.to == a; });
    return found != end ? found->triangle : -1;
  }

 private:
  struct Edge {
    int to, triangle;
  };
  /// The triangles that leave vertex v along an edge: first_[v] ... first_[v + 1] of leaving_.
  std::vector<int> first_;
  std::vector<Edge> leaving_;
};

/// Normals at the vertices, as long as the base conic's gradient (kernels/surfaces.cl): x and y.
std::vector<Eigen::Vector2d> gradients_of(const TriangleMesh& mesh, const BaseConic& base) {
  std::vector<Eigen::Vector2d> gradients(mesh.vertices.size());
  const double ck = base.curvature_per_mm * base.curvature_per_mm * (1 + base.q);
  for (std::size_t i = 0; i < gradients.size(); ++i)
    gradients[i] = mesh.normals[i].head<2>() / std::max(least_normal_z, mesh.normals[i].z()) *
                   std::sqrt(std::max(least_gradient * least_gradient,
                                      1 - ck * mesh.vertices[i].head<2>().squaredNorm()));
  return gradients;
}

/// Gradients differ by so little over a triangle that 16 bits hold their differences, in this unit.
double unit_of_differences(const std::vector<Eigen::Vector2d>& gradients,
                           const std::vector<std::array<int, 3>>& triangles) {
  double largest = 1e-9;
  for (const auto& [a, b, c] : triangles)
    for (const int other : {b, c})
      largest = std::max(largest, (gradients[other] - gradients[a]).cwiseAbs().maxCoeff());
  return largest / 32767;
}

float two_differences(double by_u, double by_v, double unit) {
  const auto in_units = [&](double value) { return static_cast<int>(std::lround(value / unit)); };
  return int_bits(static_cast<std::uint32_t>(in_units(by_u) & 0xffff) |
                  static_cast<std::uint32_t>(in_units(by_v) & 0xffff) << 16U);
}

/// TRIANGLES in kernels/surfaces.cl.
std::vector<float> triangle_records(const TriangleMesh& mesh,
                                    const std::vector<std::array<int, 3>>& triangles,
                                    const std::vector<Eigen::Vector2d>& gradients, double unit) {
  const Neighbours neighbours(triangles, mesh.vertices.size());
  const auto record_across = [&](int from, int to) {
    const int triangle = neighbours.across(from, to);
    return int_bits(triangle < 0 ? -1 : triangle * floats_a_triangle);
  };
  std::vector<float> records;
  records.reserve(triangles.size() * floats_a_triangle);
  for (const auto& [a, b, c] : triangles) {
    const Eigen::Vector3d pa = mesh.vertices[a], u = mesh.vertices[b] - pa, v = mesh.vertices[c] - pa;
    const double twice_area = u.x() * v.y() - u.y() * v.x();
    const Eigen::Vector2d along_u = Eigen::Vector2d(v.y(), -v.x()) / twice_area,
                          along_v = Eigen::Vector2d(-u.y(), u.x()) / twice_area;
    const auto push = [&](double at_a, const Eigen::Vector2d& slope) {
      for (const double value : {at_a - slope.dot(pa.head<2>()), slope.x(), slope.y()})
        records.push_back(static_cast<float>(value));
    };
    push(pa.z(), along_u * u.z() + along_v * v.z());
    push(0, along_u);
    push(0, along_v);
    const Eigen::Vector2d &g = gradients[a], by_u = gradients[b] - g, by_v = gradients[c] - g;
    records.insert(records.end(),
                   {record_across(c, a), record_across(a, b), record_across(b, c), static_cast<float>(g.x()),
                    static_cast<float>(g.y()), two_differences(by_u.x(), by_v.x(), unit),
                    two_differences(by_u.y(), by_v.y(), unit)});
  }
  return records;
}

}  // namespace

DeviceSurface triangle_walk(const TriangleMesh& mesh, const BaseConic& base) {
  double reach = 0;
  for (const auto& vertex : mesh.vertices) reach = std::max(reach, vertex.head<2>().cwiseAbs().maxCoeff());
  const auto triangles = ordered(mesh, reach);
  const auto gradients = gradients_of(mesh, base);
  const double unit = unit_of_differences(gradients, triangles);
  DeviceSurface form;
  form.kind = Operation::triangles;
  form.records = triangle_records(mesh, triangles, gradients, unit);
  const int size =
      std::max(8, static_cast<int>(std::sqrt(cells_a_triangle * static_cast<double>(triangles.size()))));
  form.columns = size;
  for (const int seed : seed_grid(mesh, triangles, size, reach))
    form.seeds.push_back(int_bits(seed * floats_a_triangle));
  form.parameters = {base.curvature_per_mm,
                     base.curvature_per_mm * (1 + base.q),
                     -reach,
                     unit,
                     size / (2 * reach),
                     size - 0.001,
                     0,
                     0,
                     0,
                     base.offset_mm};
  return form;
}

}  // namespace emmetrope::raytrace
