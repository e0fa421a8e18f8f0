#pragma once
#include <Eigen/Core>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// What a stack shows in the middle of a globe, where nothing is but vitreous.
struct VitreousNoise {
  double relative = 0;     ///< standard deviation about a quadratic of place, over the mean
  double correlation = 0;  ///< of that with what another stack shows there
};

/// Compares a stack with another at the stack's own voxels. Two acquisitions have different noise, whatever anatomy they
/// share; the same acquisition filtered, corrected for the coil, or cut along other planes keeps its own.
/// \param globe  its centre, LPS
VitreousNoise compare_noise(const Stack& stack, const Stack& other, const Eigen::Vector3d& globe);

/// Whether two stacks are one acquisition, stored twice. Nothing is told of images without noise.
bool is_one_acquisition(const Stack& a, const Stack& b, const Eigen::Vector3d& globe);

}  // namespace emmetrope::segmentation
