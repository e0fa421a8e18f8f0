#include "pipeline/eye/surfaces/triangle_hierarchy.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace emmetrope {
namespace {

constexpr int leaf_size = 4;
/// How far outside its triangle a hit may lie, in barycentric weight: rounding of a ray through an edge.
constexpr double edge_slack = 1e-10;
constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

TriangleHierarchy::TriangleHierarchy(const TriangleMesh& mesh) : order_(mesh.triangles.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  std::vector<Eigen::Vector3d> centres;
  for (const auto& t : mesh.triangles) {
    corners_.push_back({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    centres.push_back((corners_.back()[0] + corners_.back()[1] + corners_.back()[2]) / 3);
  }
  if (!order_.empty()) build(mesh, centres, 0, static_cast<int>(order_.size()));
}

int TriangleHierarchy::build(const TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& centres, int first,
                             int count) {
  const int self = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  Eigen::Vector3d low = Eigen::Vector3d::Constant(infinity), high = -low, centre_low = low,
                  centre_high = high;
  for (int k = first; k < first + count; ++k) {
    for (const Eigen::Vector3d& corner : corners_[order_[k]]) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
    centre_low = centre_low.cwiseMin(centres[order_[k]]);
    centre_high = centre_high.cwiseMax(centres[order_[k]]);
  }
  // Room for the edge slack and for boxes without thickness.
  const Eigen::Vector3d room = Eigen::Vector3d::Constant(1e-9 * (1 + (high - low).maxCoeff()));
  nodes_[self].low = low - room;
  nodes_[self].high = high + room;
  if (count <= leaf_size) {
    nodes_[self].first = first;
    nodes_[self].count = count;
    return self;
  }
  int axis = 0;
  (centre_high - centre_low).maxCoeff(&axis);
  const int half = count / 2;
  std::nth_element(order_.begin() + first, order_.begin() + first + half, order_.begin() + first + count,
                   [&](int a, int b) { return centres[a][axis] < centres[b][axis]; });
  build(mesh, centres, first, half);
  const int right = build(mesh, centres, first + half, count - half);
  nodes_[self].right = right;
  return self;
}

/// Moeller and Trumbore (1997), both sides.
std::optional<TriangleHierarchy::Hit> TriangleHierarchy::meet(const Ray& ray, int triangle) const {
  const auto& [a, b, c] = corners_[triangle];
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const Eigen::Vector3d p = ray.direction.cross(ac);
  const double determinant = ab.dot(p);
  if (determinant == 0) return std::nullopt;
  const Eigen::Vector3d s = ray.origin - a;
  const double u = s.dot(p) / determinant;
  if (!(u >= -edge_slack && u <= 1 + edge_slack)) return std::nullopt;
  const Eigen::Vector3d q = s.cross(ab);
  const double v = ray.direction.dot(q) / determinant;
  if (!(v >= -edge_slack && u + v <= 1 + edge_slack)) return std::nullopt;
  return Hit{ac.dot(q) / determinant, triangle, {1 - u - v, u, v}};
}

template <typename Visit>
void TriangleHierarchy::traverse(const Ray& ray, double shortest, const double& longest,
                                 const Visit& visit) const {
  if (nodes_.empty()) return;
  const Eigen::Array3d inverse = ray.direction.array().inverse();
  std::array<int, 64> stack;
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const int index = stack[--top];
    const Node& node = nodes_[index];
    double from = shortest, to = longest;
    for (int k = 0; k < 3; ++k) {
      double near = (node.low[k] - ray.origin[k]) * inverse[k],
             far = (node.high[k] - ray.origin[k]) * inverse[k];
      if (near > far) std::swap(near, far);
      // NaN (a ray within a box's face) leaves the bounds as they are.
      if (near > from) from = near;
      if (far < to) to = far;
    }
    if (from > to) continue;
    for (int k = node.first; k < node.first + node.count; ++k)
      if (const std::optional<Hit> hit = meet(ray, order_[k])) visit(*hit);
    if (node.right >= 0) {
      stack[top++] = node.right;
      stack[top++] = index + 1;
    }
  }
}

std::optional<TriangleHierarchy::Hit> TriangleHierarchy::nearest(const Ray& ray) const {
  std::optional<Hit> best;
  double longest = infinity;
  traverse(ray, -behind_mm, longest, [&](const Hit& hit) {
    if (hit.distance_mm < -behind_mm || hit.distance_mm >= longest) return;
    best = hit;
    longest = hit.distance_mm;
  });
  return best;
}

std::vector<TriangleHierarchy::Hit> TriangleHierarchy::all(const Ray& ray) const {
  std::vector<Hit> hits;
  const double longest = infinity;
  traverse(ray, -infinity, longest, [&](const Hit& hit) { hits.push_back(hit); });
  std::sort(hits.begin(), hits.end(), [](const Hit& a, const Hit& b) {
    return a.distance_mm != b.distance_mm ? a.distance_mm < b.distance_mm : a.triangle < b.triangle;
  });
  return hits;
}

}  // namespace emmetrope
