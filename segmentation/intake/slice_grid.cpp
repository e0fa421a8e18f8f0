#include "segmentation/intake/slice_grid.hpp"

#include <algorithm>
#include <cmath>

namespace emmetrope::segmentation {
namespace {

std::vector<double> steps_of(const std::vector<double>& positions) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < positions.size(); ++i) steps.push_back(positions[i] - positions[i - 1]);
  return steps;
}

}  // namespace

double median_step_mm(const std::vector<double>& along_normal_mm) {
  auto steps = steps_of(along_normal_mm);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

// Plane numbers by rounding to the step, then the straight line through (plane, position).
SliceGrid slice_grid_of_step(const std::vector<double>& along_normal_mm, double step_mm) {
  SliceGrid grid;
  grid.plane = {0};
  for (const double distance : steps_of(along_normal_mm))
    grid.plane.push_back(grid.plane.back() +
                         static_cast<int>(std::clamp(std::round(distance / step_mm), 1.0, 1e6)));
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

SliceGrid fit_slice_grid(const std::vector<double>& along_normal_mm) {
  if (along_normal_mm.size() == 1) {
    SliceGrid single;
    single.plane = {0};
    single.start_mm = along_normal_mm.front();
    return single;
  }
  auto steps = steps_of(along_normal_mm);
  std::sort(steps.rbegin(), steps.rend());
  for (const double step : steps)
    if (auto grid = slice_grid_of_step(along_normal_mm, step); grid.deviation_mm <= on_grid_mm) return grid;
  return slice_grid_of_step(along_normal_mm, median_step_mm(along_normal_mm));
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

double whole_extent_mm(const Stack& stack) {
  return std::max({stack.columns * stack.column_spacing_mm, stack.rows * stack.row_spacing_mm,
                   stack.slices() * stack.slice_spacing_mm()});
}

}  // namespace emmetrope::segmentation
