#pragma once
#include <string>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Planes of a stack normal to its columns' axis (0), its rows' (1), its slices' (2).
int count_planes(const Stack& stack, int axis);

/// One, or neighbouring ones, counted from a side of the patient: "sagittal planes 54 to 57 of 173, counted from the patient's
/// right".
std::string planes_in_words(const Stack& stack, int axis, int first, int last);

}  // namespace emmetrope::segmentation
