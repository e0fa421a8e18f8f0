#pragma once
#include <optional>
#include <vector>

#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/eye/surfaces/shape.hpp"

namespace emmetrope {

/// Bounding volume hierarchy over the triangles of a mesh, float64; median splits, a few triangles a leaf.
class TriangleHierarchy {
 public:
  explicit TriangleHierarchy(const TriangleMesh& mesh);

  struct Hit {
    double distance_mm = 0;
    int triangle = -1;
    Eigen::Vector3d weights{0, 0, 0};  ///< barycentric, of the triangle's three corners
  };
  /// The nearest hit at a distance of at least -1e-9 mm. Edges belong to their triangles, so that no ray
  /// slips through.
  std::optional<Hit> nearest(const Ray& ray) const;
  /// All hits, in order of distance; negative ones too.
  std::vector<Hit> all(const Ray& ray) const;

 private:
  struct Node {
    Eigen::Vector3d low, high;
    int first = 0, count = 0;  ///< a leaf's triangles in order_
    int right = -1;            ///< an inner node's second child; the first follows it
  };
  int build(const TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& centres, int first, int count);
  std::optional<Hit> meet(const Ray& ray, int triangle) const;
  template <typename Visit>
  void traverse(const Ray& ray, double shortest, const double& longest, const Visit& visit) const;

  std::vector<Node> nodes_;
  std::vector<int> order_;
  std::vector<std::array<Eigen::Vector3d, 3>> corners_;
};

}  // namespace emmetrope
