#include "segmentation/finding/radial_symmetry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double grid_mm = 1.5;

/// A stack resampled to a cubic grid along its own axes, about its middle: a mirrored stack's is the mirrored one.
struct Grid {
  Vector3i size;
  Vector3d origin, x, y, z;
  std::vector<float> value;
  std::vector<char> is_blank;

  std::size_t index(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * size.y() + j) * size.x() + i;
  }
  Vector3i node(std::size_t index) const {
    return {static_cast<int>(index % size.x()), static_cast<int>(index / size.x() % size.y()),
            static_cast<int>(index / size.x() / size.y())};
  }
  /// Central differences, without the spacing; not at the border.
  Vector3d gradient(int i, int j, int k) const {
    return Vector3d(value[index(i + 1, j, k)] - value[index(i - 1, j, k)],
                    value[index(i, j + 1, k)] - value[index(i, j - 1, k)],
                    value[index(i, j, k + 1)] - value[index(i, j, k - 1)]);
  }
  /// Whether a central difference here uses a node that holds what was blanked.
  bool touches_blank(int i, int j, int k) const {
    return is_blank[index(i - 1, j, k)] || is_blank[index(i + 1, j, k)] || is_blank[index(i, j - 1, k)] ||
           is_blank[index(i, j + 1, k)] || is_blank[index(i, j, k - 1)] || is_blank[index(i, j, k + 1)];
  }
  Vector3d position(const Vector3d& g) const {
    return origin + grid_mm * (g.x() * x + g.y() * y + g.z() * z);
  }
};

/// Indices of the voxels of an axis that lie about a place within half of the grid's spacing, so that noise and ringing of
/// fine voxels do not vote, or half of their own where that is larger.
struct Span {
  int first, last;
};
Span span_about(double at, double spacing_mm, int count) {
  constexpr double rounding = 1e-9;
  const double reach = std::max(0.5, 0.5 * grid_mm / spacing_mm) + rounding;
  return {std::max(0, static_cast<int>(std::ceil(at - reach))),
          std::min(count - 1, static_cast<int>(std::floor(at + reach)))};
}

/// Mean of a rectangle of voxels, between two slices.
/// \param slice  fractional
float mean_in_plane(const Stack& stack, double slice, const Span& columns, const Span& rows) {
  const int s0 = std::clamp(static_cast<int>(slice), 0, stack.slices() - 1),
            s1 = std::min(s0 + 1, stack.slices() - 1);
  const double w = std::clamp(slice - s0, 0.0, 1.0);
  double sum = 0;
  int count = 0;
  for (int r = rows.first; r <= rows.last; ++r) {
    for (int c = columns.first; c <= columns.last; ++c) {
      sum += (1 - w) * stack.at(c, r, s0) + w * stack.at(c, r, s1);
      ++count;
    }
  }
  return count ? static_cast<float>(sum / count) : 0;
}

Grid resample(const Stack& stack, const BlankedRegion& blanked) {
  Grid grid;
  grid.x = stack.along_row;
  grid.y = stack.along_column;
  grid.z = stack.normal;
  const double depth = stack.normal.dot(stack.slice_position.back() - stack.slice_position.front());
  // Not another number of nodes for a spacing that a header rounds.
  const auto nodes_in = [](double extent_mm) { return static_cast<int>(extent_mm / grid_mm + 1e-4) + 1; };
  grid.size = {nodes_in((stack.columns - 1) * stack.column_spacing_mm),
               nodes_in((stack.rows - 1) * stack.row_spacing_mm), nodes_in(depth)};
  const Vector3d middle(0.5 * (stack.columns - 1), 0.5 * (stack.rows - 1), 0.5 * (stack.slices() - 1)),
      spacing_mm(stack.column_spacing_mm, stack.row_spacing_mm, stack.slice_spacing_mm());
  // Of a node: from the stack's middle in mm, and as an index of columns, rows and slices.
  const auto from_middle_mm = [&](const Vector3i& node) -> Vector3d {
    return grid_mm * (node.cast<double>() - (grid.size - Vector3i::Ones()).cast<double>() / 2);
  };
  const auto index_at = [&](const Vector3i& node) -> Vector3d {
    return middle + from_middle_mm(node).cwiseQuotient(spacing_mm);
  };
  const Vector3d first_mm = from_middle_mm(Vector3i::Zero());
  grid.origin = stack.slice_position.front() + (middle.x() * spacing_mm.x() + first_mm.x()) * grid.x +
                (middle.y() * spacing_mm.y() + first_mm.y()) * grid.y + (depth / 2 + first_mm.z()) * grid.z;
  grid.value.assign(static_cast<std::size_t>(grid.size.prod()), 0);
  grid.is_blank.assign(grid.value.size(), 0);
  const Sampler sampler(stack);
  for (int k = 0; k < grid.size.z(); ++k) {
    for (int j = 0; j < grid.size.y(); ++j) {
      for (int i = 0; i < grid.size.x(); ++i) {
        const Vector3d position = grid.position({double(i), double(j), double(k)});
        const auto at = sampler.voxel_coordinates(position);
        // A plane missing from the stack shows its nearest neighbour here: good enough to find an eye.
        const Vector3d index = index_at({i, j, k});
        grid.value[grid.index(i, j, k)] = mean_in_plane(stack, at ? at->z() : index.z(),
                                                        span_about(index.x(), spacing_mm.x(), stack.columns),
                                                        span_about(index.y(), spacing_mm.y(), stack.rows));
        grid.is_blank[grid.index(i, j, k)] = blanked.holds(sampler, position) ? 1 : 0;
      }
    }
  }
  return grid;
}

/// Calls `visit(i, j, k)` for each node of a grid that is not at its border.
template <typename Visit>
void for_each_inner_node(const Vector3i& size, const Visit& visit) {
  for (int k = 1; k + 1 < size.z(); ++k)
    for (int j = 1; j + 1 < size.y(); ++j)
      for (int i = 1; i + 1 < size.x(); ++i) visit(i, j, k);
}

/// Votes on the nodes of a grid, for centres of dark balls (T1) and of bright ones (T2).
using Votes = std::array<std::vector<float>, 2>;
constexpr std::array<Weighting, 2> polarities{Weighting::t1, Weighting::t2};

/// \return empty where the grid is too small or has no edges
Votes cast_votes(const Grid& grid) {
  std::vector<double> magnitudes;
  for_each_inner_node(grid.size, [&](int i, int j, int k) {
    if (!grid.touches_blank(i, j, k)) magnitudes.push_back(grid.gradient(i, j, k).norm());
  });
  if (magnitudes.empty()) return {};
  const double strong = quantile(magnitudes, 0.90), weak = quantile(magnitudes, 0.70);
  if (!(strong > 0)) return {};

  Votes votes;
  for (auto& volume : votes) volume.assign(grid.value.size(), 0);
  for_each_inner_node(grid.size, [&](int i, int j, int k) {
    if (grid.touches_blank(i, j, k)) return;
    const Vector3d g = grid.gradient(i, j, k);
    const double magnitude = g.norm();
    if (magnitude < weak || magnitude == 0) return;
    const Vector3d towards_bright = g / magnitude;
    const auto weight = static_cast<float>(std::min(magnitude / strong, 1.0));
    for (const int polarity : {0, 1}) {
      for (double radius = smallest_globe_mm; radius <= largest_globe_mm; radius += 1) {
        const Vector3d target = Vector3d(i, j, k) + (polarity ? 1 : -1) * radius / grid_mm * towards_bright;
        const Vector3i t = (target.array() + 0.5).floor().cast<int>();
        if ((t.array() < 0).any() || (t.array() >= grid.size.array()).any()) continue;
        votes[polarity][grid.index(t.x(), t.y(), t.z())] += weight;
      }
    }
  });
  return votes;
}

/// Sums over 5 nodes along each axis: votes for one eye spread over about 5 mm.
std::vector<float> box_sums(std::vector<float> values, const Grid& grid) {
  const Vector3i n = grid.size;
  const std::array<std::ptrdiff_t, 3> stride{1, n.x(), static_cast<std::ptrdiff_t>(n.x()) * n.y()};
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<float> next(values.size(), 0);
    for (int k = 0; k < n.z(); ++k)
      for (int j = 0; j < n.y(); ++j)
        for (int i = 0; i < n.x(); ++i) {
          const Vector3i at(i, j, k);
          const std::size_t here = grid.index(i, j, k);
          float sum = 0;
          for (int o = -2; o <= 2; ++o) {
            const int c = at[axis] + o;
            if (c >= 0 && c < n[axis]) sum += values[here + o * stride[axis]];
          }
          next[here] = sum;
        }
    values = std::move(next);
  }
  return values;
}

/// Positions of the highest values, apart from each other.
std::vector<Vector3d> maxima(const std::vector<float>& values, const Grid& grid) {
  constexpr std::size_t most = 10, considered = 4000;
  constexpr double apart_mm = 10;
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const std::size_t top = std::min(order.size(), considered);
  std::partial_sort(
      order.begin(), order.begin() + static_cast<std::ptrdiff_t>(top), order.end(),
      [&](std::size_t a, std::size_t b) { return values[a] != values[b] ? values[a] > values[b] : a < b; });
  std::vector<Vector3d> positions;
  for (std::size_t o = 0; o < top && positions.size() < most; ++o) {
    const Vector3d position = grid.position(grid.node(order[o]).cast<double>());
    const bool known = std::any_of(positions.begin(), positions.end(), [&](const Vector3d& other) {
      return (other - position).norm() < apart_mm;
    });
    if (!known) positions.push_back(position);
  }
  return positions;
}

}  // namespace

std::vector<SymmetryPeak> symmetry_peaks(const Stack& stack, const BlankedRegion& blanked) {
  const Grid grid = resample(stack, blanked);
  const Votes votes = cast_votes(grid);
  if (votes[0].empty()) return {};
  std::vector<SymmetryPeak> peaks;
  for (const int polarity : {0, 1})
    for (const Vector3d& position : maxima(box_sums(votes[polarity], grid), grid))
      peaks.push_back({position, polarities[polarity]});
  return peaks;
}

}  // namespace emmetrope::segmentation
