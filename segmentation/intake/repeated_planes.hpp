#pragma once
#include <string>
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Planes of a volume, normal to one of its axes, that hold the same voxels as their neighbours. The noise of two
/// acquired planes is never the same.
struct RepeatedPlanes {
  int axis = 0;                   ///< 0: of columns, 1: of rows, 2: of slices
  std::vector<int> same_as_next;  ///< each plane whose next one is the same, ascending
  bool throughout = false;        ///< evenly along the whole axis: voxels were repeated to enlarge the volume
};

/// Of each axis that has some. Planes of one value throughout show nothing, and copies of the outermost one that shows
/// something are a border that was laid around the image: neither counts.
std::vector<RepeatedPlanes> find_repeated_planes(const Stack& stack);

/// Which planes these are: "sagittal planes 54 to 57 of 173, counted from the patient's right".
std::string described(const RepeatedPlanes& repeated, const Stack& stack);

}  // namespace emmetrope::segmentation
