#include "raytrace/system/box_hierarchy.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "raytrace/system/int_bits.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr int leaf_size = 4, bins = 16;

double area(const Eigen::AlignedBox3d& box) {
  if (box.isEmpty()) return 0;
  const Eigen::Vector3d s = box.sizes();
  return s.x() * s.y() + s.y() * s.z() + s.z() * s.x();
}

class HierarchyBuilder {
 public:
  explicit HierarchyBuilder(const std::vector<std::array<Eigen::Vector3d, 3>>& triangles) {
    for (const auto& corners : triangles) {
      boxes_.emplace_back();
      for (const auto& corner : corners) boxes_.back().extend(corner);
      centres_.push_back((corners[0] + corners[1] + corners[2]) / 3);
    }
    result.order.resize(triangles.size());
    std::iota(result.order.begin(), result.order.end(), 0);
    if (!triangles.empty()) build(0, static_cast<int>(triangles.size()));
  }

  BoxHierarchy result;

 private:
  void build(int first, int count) {
    const std::size_t self = result.nodes.size();
    result.nodes.resize(self + BoxHierarchy::node_floats);
    Eigen::AlignedBox3d box, centres;
    for (int k = first; k < first + count; ++k) {
      box.extend(boxes_[result.order[k]]);
      centres.extend(centres_[result.order[k]]);
    }
    // Room for float32: of the box's own corners and of where the ray is.
    const double room =
        2e-6 * (1 + std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()));
    const bool is_leaf = count <= leaf_size;
    if (!is_leaf) {
      const int left = split(first, count, centres);
      build(first, left);
      build(first + left, count - left);
    }
    for (int c = 0; c < 3; ++c) {
      result.nodes[self + c] = static_cast<float>(box.min()[c] - room);
      result.nodes[self + 4 + c] = static_cast<float>(box.max()[c] + room);
    }
    result.nodes[self + 3] = int_bits(result.nodes.size() / BoxHierarchy::node_floats);
    result.nodes[self + 7] = int_bits(is_leaf ? first * 16 + count : 0);
  }

  /// Where the cost (area times triangles of both halves) is least among the bins' borders of the longest
  /// axis; the median where all centres coincide. Returns how many go left.
  int split(int first, int count, const Eigen::AlignedBox3d& centres) {
    int axis = 0;
    const double extent = centres.sizes().maxCoeff(&axis);
    const auto begin = result.order.begin() + first, end = begin + count;
    const auto bin_of = [&](int triangle) {
      return std::min(bins - 1,
                      static_cast<int>(bins * (centres_[triangle][axis] - centres.min()[axis]) / extent));
    };
    if (!(extent > 0)) return count / 2;
    std::array<Eigen::AlignedBox3d, bins> boxes;
    std::array<int, bins> counts{};
    for (auto t = begin; t != end; ++t) {
      boxes[bin_of(*t)].extend(boxes_[*t]);
      ++counts[bin_of(*t)];
    }
    std::array<double, bins> right_cost{};
    Eigen::AlignedBox3d right;
    int right_count = 0;
    for (int b = bins - 1; b > 0; --b) {
      right.extend(boxes[b]);
      right_cost[b] = area(right) * (right_count += counts[b]);
    }
    Eigen::AlignedBox3d left;
    int left_count = 0, best = 1;
    double least = std::numeric_limits<double>::infinity();
    for (int b = 1; b < bins; ++b) {
      left.extend(boxes[b - 1]);
      left_count += counts[b - 1];
      const double cost = area(left) * left_count + right_cost[b];
      if (left_count > 0 && left_count < count && cost < least) {
        least = cost;
        best = b;
      }
    }
    const auto middle = std::stable_partition(begin, end, [&](int t) { return bin_of(t) < best; });
    return static_cast<int>(middle - begin);
  }

  std::vector<Eigen::AlignedBox3d> boxes_;
  std::vector<Eigen::Vector3d> centres_;
};

}  // namespace

BoxHierarchy make_box_hierarchy(const std::vector<std::array<Eigen::Vector3d, 3>>& triangles) {
  return std::move(HierarchyBuilder(triangles).result);
}

}  // namespace emmetrope::raytrace
