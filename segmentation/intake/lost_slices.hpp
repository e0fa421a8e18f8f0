#pragma once
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Slices, ascending, that do not show what lies at their place: those of one value throughout between others, and all
/// that hold the same voxels, be it under another scale (nothing tells which of them is at its own place). The noise of two
/// slices that were acquired is never the same. What is empty at the ends of a stack is beyond the head.
std::vector<int> find_lost_slices(const Stack& stack);

}  // namespace emmetrope::segmentation
