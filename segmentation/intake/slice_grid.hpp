#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// The regular grid of planes that fits the slices best. Slice i lies near plane[i]; planes without a slice
/// are gaps.
struct SliceGrid {
  std::vector<int> plane;   ///< of each slice, ascending from 0
  double spacing_mm = 0;    ///< of the planes
  double start_mm = 0;      ///< projection of plane 0 on the normal
  double deviation_mm = 0;  ///< largest distance of a slice from its plane along the normal

  int planes() const { return plane.empty() ? 0 : plane.back() + 1; }
  bool has_gaps() const { return planes() > static_cast<int>(plane.size()); }
};

/// A slice this near to its plane is on the grid: 0.05 D of refraction at most, and above the rounding of
/// headers.
inline constexpr double on_grid_mm = 0.02;

/// Median distance of neighbours.
/// \param along_normal_mm  positions, ascending, at least two
double median_step_mm(const std::vector<double>& along_normal_mm);

/// Least-squares grid through slice positions whose neighbours are multiples of a step apart, but for rounding.
/// \param along_normal_mm  positions along the normal, ascending, at least two
SliceGrid slice_grid_of_step(const std::vector<double>& along_normal_mm, double step_mm);

/// The same of a step that is not told: the coarsest whose step occurs between two slices and that has
/// all slices on it; of the median step where there is none.
/// \param along_normal_mm  positions along the normal, ascending, at least one
SliceGrid fit_slice_grid(const std::vector<double>& along_normal_mm);
SliceGrid fit_slice_grid(const Stack& stack);

}  // namespace emmetrope::segmentation
