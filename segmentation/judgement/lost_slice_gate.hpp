#pragma once
#include "segmentation/judgement/judged_eye.hpp"

namespace emmetrope::segmentation {

/// Withholds an eye, fit and edges, that a lost slice of a DICOM stack crosses: what should be seen there is not, or is
/// another place's.
/// \param view  of the eye, in `stack`
void judge_lost_slices(JudgedEye& eye, const EyeView& view, const Stack& stack);

}  // namespace emmetrope::segmentation
