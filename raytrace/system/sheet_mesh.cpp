#include "raytrace/system/sheet_mesh.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {
namespace {

/// Up to 0.98 of the largest circle on which the shape has a depth everywhere.
double reach_mm(const Shape& shape, double wanted) {
  const auto whole = [&](double r) {
    for (int k = 0; k < 24; ++k)
      if (!shape.depth_mm(r * std::cos(k * 15 * degree), r * std::sin(k * 15 * degree))) return false;
    return true;
  };
  if (whole(wanted / 0.98)) return wanted;
  double low = 0, high = wanted / 0.98;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (whole(middle) ? low : high) = middle;
  }
  return 0.98 * low;
}

}  // namespace

double default_semi_diameter_mm(const Surface& surface) {
  return reach_mm(*surface.shape, surface.semi_diameter_mm > 0 ? surface.semi_diameter_mm : 5.5);
}

TriangleMesh sheet_mesh(const Shape& shape, double semi_diameter_mm, int vertices, double jitter) {
  if (vertices < 7) throw usage_error("--vertices: a sheet needs at least 7 vertices");
  const double radius = reach_mm(shape, semi_diameter_mm);
  // Rings of about equal spacing; ring k of n has its share k / sum(k) of the vertices beside the centre.
  const int rings =
      std::max(1, static_cast<int>(std::lround((-1 + std::sqrt(1 + 4 * (vertices - 1) / 3.0)) / 2)));
  std::vector<int> first{0, 1};
  for (int k = 1; k <= rings; ++k)
    first.push_back(1 +
                    static_cast<int>(std::lround((vertices - 1.0) * k * (k + 1) / (rings * (rings + 1.0)))));

  std::mt19937 random(12345);
  const auto symmetric = [&] { return 2 * (random() / 4294967296.0) - 1; };
  TriangleMesh mesh;
  std::vector<double> angles;
  for (int k = 0; k <= rings; ++k) {
    const int count = first[k + 1] - first[k];
    for (int i = 0; i < count; ++i) {
      const double step = 2 * pi / count;
      const double angle = (i + 0.5 * (k % 2) + jitter * symmetric() * (k > 0)) * step;
      const double r = radius * (k + (k > 0 && k < rings ? jitter * symmetric() : 0)) / rings;
      const double x = r * std::cos(angle), y = r * std::sin(angle);
      angles.push_back(angle);
      mesh.vertices.emplace_back(x, y, -shape.depth_mm(x, y).value());
      mesh.normals.push_back(shape.normal(x, y).value());
    }
  }
  // Between two rings: go round both, each time along the ring whose next vertex comes first.
  for (int k = 0; k < rings; ++k) {
    const int inner = first[k + 1] - first[k], outer = first[k + 2] - first[k + 1];
    int i = 0, o = 0;
    const auto next_angle = [&](int ring_first, int count, int at) {
      return angles[ring_first + (at + 1) % count] + 2 * pi * ((at + 1) / count);
    };
    while (i < (inner > 1 ? inner : 0) || o < outer) {
      const int a = first[k] + i % inner, b = first[k + 1] + o % outer;
      const bool along_outer =
          inner == 1 || i >= inner ||
          (o < outer && next_angle(first[k + 1], outer, o) <= next_angle(first[k], inner, i));
      if (along_outer) {
        mesh.triangles.push_back({a, b, first[k + 1] + (o + 1) % outer});
        ++o;
      } else {
        mesh.triangles.push_back({a, b, first[k] + (i + 1) % inner});
        ++i;
      }
    }
  }
  return mesh;
}

}  // namespace emmetrope::raytrace
