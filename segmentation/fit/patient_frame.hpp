#pragma once
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// An eye that was fitted along its voxels' axes, as the model along the patient's has it: gaze, what is counted along the
/// eye's horizontal, and the covariance of both. Its globe keeps its extents along the turned axes, and its wall's
/// displacement takes up what an ellipsoid along those leaves, to a few micrometres.
/// \pre the cornea is regular
EyeFit along_patient(EyeFit fit);

}  // namespace emmetrope::segmentation
