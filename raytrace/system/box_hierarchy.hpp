#pragma once
#include <Eigen/Geometry>
#include <array>
#include <vector>

namespace emmetrope::raytrace {

/// Bounding boxes over triangles as the kernels walk them without a stack: nodes in depth-first order, 8
/// floats each: low corner (3), the node that follows the whole branch (int bits); high corner (3), a leaf's
/// first triangle x 16 + count (int bits, 0 for an inner node).
struct BoxHierarchy {
  static constexpr int node_floats = 8;
  std::vector<float> nodes;
  std::vector<int> order;  ///< which triangle stands at each place
  int node_count() const { return static_cast<int>(nodes.size()) / node_floats; }
};

/// Binned surface area heuristic, at most four triangles a leaf.
BoxHierarchy make_box_hierarchy(const std::vector<std::array<Eigen::Vector3d, 3>>& triangles);

}  // namespace emmetrope::raytrace
