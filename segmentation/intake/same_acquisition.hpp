#pragma once
#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Whether two stacks are one acquisition, stored twice as scanners do (once as it is, once made even or rescaled): they
/// lie on one grid and have the same noise. Two acquisitions of one head have edges in common, noise not.
bool is_same_acquisition(const Stack& a, const Stack& b);

}  // namespace emmetrope::segmentation
