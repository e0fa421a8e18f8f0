#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/finding/blanked_region.hpp"
#include "segmentation/intake/volume.hpp"
#include "segmentation/intake/weighting.hpp"

namespace emmetrope::segmentation {

/// Radii of the balls that are looked for.
inline constexpr double smallest_globe_mm = 9, largest_globe_mm = 14;

/// A place that many edges have at a globe's radius along their gradient.
struct SymmetryPeak {
  Eigen::Vector3d position;  ///< LPS, mm
  Weighting weighting;       ///< T2: of a bright ball; T1: of a dark one
};

/// Radial symmetry (Loy and Zelinsky 2003) in three dimensions: the edges of a stack, resampled to 1.5 mm,
/// vote for centres of balls along their gradient; the ten highest maxima of each polarity, 10 mm apart.
std::vector<SymmetryPeak> symmetry_peaks(const Stack& stack, const BlankedRegion& blanked);

}  // namespace emmetrope::segmentation
