#include "segmentation/intake/same_acquisition.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace emmetrope::segmentation {
namespace {

bool are_on_one_grid(const Stack& a, const Stack& b) {
  if (a.columns != b.columns || a.rows != b.rows || a.slices() != b.slices()) return false;
  constexpr double same_place_mm = 0.01;
  for (int slice = 0; slice < a.slices(); ++slice)
    for (const auto& [column, row] : {std::pair{0, 0}, std::pair{a.columns - 1, a.rows - 1}})
      if ((a.position(column, row, slice) - b.position(column, row, slice)).norm() > same_place_mm)
        return false;
  return true;
}

/// What a voxel has that the four beside it in its slice do not: noise and edges.
float detail(const Stack& stack, int column, int row, int slice) {
  return stack.at(column, row, slice) -
         (stack.at(column - 1, row, slice) + stack.at(column + 1, row, slice) +
          stack.at(column, row - 1, slice) + stack.at(column, row + 1, slice)) /
             4;
}

}  // namespace

bool is_same_acquisition(const Stack& a, const Stack& b) {
  if (!are_on_one_grid(a, b)) return false;
  std::vector<float> sizes;
  std::vector<std::pair<float, float>> details;
  for (int slice = 0; slice < a.slices(); ++slice)
    for (int row = 1; row + 1 < a.rows; ++row)
      for (int column = 1; column + 1 < a.columns; ++column) {
        const float of_a = detail(a, column, row, slice), of_b = detail(b, column, row, slice);
        if (of_a == 0 || of_b == 0) continue;  // blanked, or too coarse a scale
        details.emplace_back(of_a, of_b);
        sizes.push_back(std::abs(of_a));
      }
  constexpr std::size_t fewest = 1000;
  if (details.size() < fewest) return false;
  // The smaller half: edges are larger.
  const auto median = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), median, sizes.end());
  std::size_t count = 0, alike = 0;
  for (const auto& [of_a, of_b] : details) {
    if (std::abs(of_a) > *median) continue;
    ++count;
    alike += (of_a > 0) == (of_b > 0) ? 1 : 0;
  }
  // Half of them by chance; 0.75 where noise is correlated by 0.7, as between the images of one Dixon acquisition.
  constexpr double same = 0.8;
  return static_cast<double>(alike) > same * static_cast<double>(count);
}

}  // namespace emmetrope::segmentation
