#include "segmentation/intake/slice_grid.hpp"

#include <algorithm>
#include <cmath>

namespace emmetrope::segmentation {
double median_step_mm(const std::vector<double>& positions) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < positions.size(); ++i) steps.push_back(positions[i] - positions[i - 1]);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

SliceGrid fit_slice_grid(const std::vector<double>& along_normal_mm) {
  SliceGrid grid;
  grid.plane = {0};
  grid.start_mm = along_normal_mm.front();
  if (along_normal_mm.size() == 1) return grid;

  const double step = median_step_mm(along_normal_mm);
  for (std::size_t i = 1; i < along_normal_mm.size(); ++i) {
    const double planes = std::round((along_normal_mm[i] - along_normal_mm[i - 1]) / step);
    grid.plane.push_back(grid.plane.back() + static_cast<int>(std::clamp(planes, 1.0, 1e6)));
  }
  // Straight line through (plane, position).
  const auto count = static_cast<double>(along_normal_mm.size());
  double mean_k = 0, mean_s = 0, kk = 0, ks = 0;
  for (std::size_t i = 0; i < along_normal_mm.size(); ++i) {
    mean_k += grid.plane[i] / count;
    mean_s += along_normal_mm[i] / count;
  }
  for (std::size_t i = 0; i < along_normal_mm.size(); ++i) {
    kk += (grid.plane[i] - mean_k) * (grid.plane[i] - mean_k);
    ks += (grid.plane[i] - mean_k) * (along_normal_mm[i] - mean_s);
  }
  grid.spacing_mm = ks / kk;
  grid.start_mm = mean_s - grid.spacing_mm * mean_k;
  for (std::size_t i = 0; i < along_normal_mm.size(); ++i)
    grid.deviation_mm = std::max(
        grid.deviation_mm, std::abs(along_normal_mm[i] - grid.start_mm - grid.spacing_mm * grid.plane[i]));
  return grid;
}

SliceGrid fit_slice_grid(const Stack& stack) {
  std::vector<double> along_normal;
  for (const auto& position : stack.slice_position) along_normal.push_back(stack.normal.dot(position));
  SliceGrid grid = fit_slice_grid(along_normal);
  if (grid.spacing_mm == 0) grid.spacing_mm = stack.slice_thickness_mm;
  return grid;
}

double Stack::slice_spacing_mm() const {
  if (slices() < 2) return slice_thickness_mm;
  std::vector<double> along_normal;
  for (const auto& position : slice_position) along_normal.push_back(normal.dot(position));
  return median_step_mm(along_normal);
}

}  // namespace emmetrope::segmentation
