#pragma once
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Share of a place's voxels that have a value at the end of their stack's range, and that value.
struct ClippedShare {
  double share = 0, value = 0;
};

/// Of a scanner's grey values few voxels have the highest, and none of the eye itself; where somebody cut them off (a
/// windowed export), all beyond have.
struct ClippedValues {
  ClippedShare about_eye;  ///< the highest, within 16 mm of the globe's centre
  ClippedShare lens;       ///< the highest or the lowest
  ClippedShare
      vitreous;  ///< the highest or the lowest, within 5 mm of the globe's centre, but what was blanked
};
/// Of the stack that has most of them in each place; none where labels are the evidence.
ClippedValues clipped_values(const EyeFit& fit);
/// Of the vitreous of a globe, which needs no fit.
ClippedShare clipped_vitreous(const Stack& stack, const Eigen::Vector3d& globe_centre_lps);

}  // namespace emmetrope::segmentation
