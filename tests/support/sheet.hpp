#pragma once
#include <cmath>
#include <map>
#include <random>

#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/eye/surfaces/shape.hpp"

namespace emmetrope::testing_eye {

/// An irregular sheet over a disc: a square grid of about `vertices` points, jittered by a quarter of its
/// spacing, points exactly on the shape, with the shape's own normals.
inline TriangleMesh jittered_sheet(const Shape& shape, double semi_diameter_mm, int vertices, unsigned seed) {
  const double spacing = semi_diameter_mm * std::sqrt(3.14159265 / vertices);
  const int half = static_cast<int>(semi_diameter_mm / spacing) + 1;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> jitter(-0.25, 0.25);
  TriangleMesh mesh;
  std::map<std::pair<int, int>, int> index;
  for (int j = -half; j <= half; ++j)
    for (int i = -half; i <= half; ++i) {
      const double x = (i + jitter(random)) * spacing, y = (j + jitter(random)) * spacing;
      if (std::hypot(i, j) * spacing > semi_diameter_mm) continue;
      const auto depth = shape.depth_mm(x, y);
      if (!depth) continue;
      index[{i, j}] = static_cast<int>(mesh.vertices.size());
      mesh.vertices.emplace_back(x, y, -*depth);
      mesh.normals.push_back(*shape.normal(x, y));
    }
  const auto add = [&](std::pair<int, int> a, std::pair<int, int> b, std::pair<int, int> c) {
    const auto ia = index.find(a), ib = index.find(b), ic = index.find(c);
    if (ia != index.end() && ib != index.end() && ic != index.end())
      mesh.triangles.push_back({ia->second, ib->second, ic->second});
  };
  for (int j = -half; j < half; ++j)
    for (int i = -half; i < half; ++i) {
      if ((i + j) % 2 == 0) {
        add({i, j}, {i + 1, j}, {i + 1, j + 1});
        add({i, j}, {i + 1, j + 1}, {i, j + 1});
      } else {
        add({i, j}, {i + 1, j}, {i, j + 1});
        add({i + 1, j}, {i + 1, j + 1}, {i, j + 1});
      }
    }
  return mesh;
}

}  // namespace emmetrope::testing_eye
