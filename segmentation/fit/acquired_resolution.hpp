#pragma once
#include <Eigen/Core>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// How fine a stack was acquired: voxels that were interpolated between acquired ones, as scanners do by filling
/// k-space with zeros, tell nothing that these do not.
struct AcquiredResolution {
  /// Of the frequencies that columns, rows and slices can hold, the share that they do hold; 1: as they are stored.
  Eigen::Vector3d share = Eigen::Vector3d::Ones();

  /// Of so many voxels those that are independent.
  double independent(double voxels) const { return voxels * share.prod(); }
};

/// From the power of the frequencies along columns, rows and slices. Images' power falls with the square of the
/// frequency, down to the noise; where it falls 12 dB below that and stays there nothing was acquired. Edges of what
/// somebody has blanked have all frequencies: the share is 1 then.
/// \param stack  the part of a stack about an eye
AcquiredResolution acquired_resolution(const Stack& stack);

}  // namespace emmetrope::segmentation
