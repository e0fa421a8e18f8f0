#pragma once
#include "segmentation/judgement/judged_eye.hpp"

namespace emmetrope::segmentation {

/// Withholds an eye, fit and edges, across which a plane of a volume seems to be missing: a file whose header does not
/// tell where each plane lies cannot say so. Slices that the fit finds displaced have been told to be.
/// \param view  of the eye, in `stack`
void judge_plane_steps(JudgedEye& eye, const EyeView& view, const Stack& stack);

}  // namespace emmetrope::segmentation
