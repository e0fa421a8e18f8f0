#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Where someone blanked the image around an eye, as those do who take a face off: noise leaves no voxel that is zero
/// with all its neighbours. Nothing can be read there, nor where an interpolation would reach into it.
class BlankedRegion {
 public:
  /// Nothing is blanked.
  BlankedRegion() = default;
  /// Within so far of the globe's centre (LPS); nothing where most of its middle is zero, as dark vitreous is in a window.
  BlankedRegion(const Stack& stack, const Eigen::Vector3d& globe_centre, double radius_mm);

  bool holds_voxel(int column, int row, int slice) const;
  /// Whether an interpolation over four voxels a direction reaches into it.
  /// \param stack  the one that it is of
  bool holds(const Stack& stack, const Eigen::Vector3d& lps) const;
  /// Whether a quarter of a usual lens, 8 mm before the globe's centre, was blanked.
  bool holds_lens(const Stack& stack, const Eigen::Vector3d& globe_centre, const Eigen::Vector3d& axis) const;

 private:
  bool is_core(const Eigen::Array3i& voxel) const;

  Eigen::Array3i first_ = Eigen::Array3i::Zero(), count_ = Eigen::Array3i::Zero();  ///< column, row, slice
  std::vector<char> core_;  ///< of the voxels from `first_` on: zero with all neighbours
};

}  // namespace emmetrope::segmentation
