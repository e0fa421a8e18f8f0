#pragma once
#include "segmentation/fit/eye_distances.hpp"

/// One eye in images of two contrasts, each fitted with its own pose, tissues and scanner: the eye's shape is one.
namespace emmetrope::segmentation {

/// How well two fits agree: their distance that is farthest apart in standard deviations of both, and the root mean square
/// of all distances' (Birge's ratio), without what both err by alike (EyeFit::common_covariance). The prior that both share
/// is no part taken off: where images say little, both are lower bounds.
struct Agreement {
  Distance farthest = pole_depth;
  double apart_mm = 0;  ///< the first less the second
  double sigmas = 0;
  double weight_of_first = 0.5;  ///< by its precision in that distance
  double birge_ratio = 0;
};
Agreement agreement_of(const EyeFit& first, const EyeFit& second);

/// What of an eye's shape two fits are joined in.
enum class Joined {
  all,            ///< the wall's displacement, globe, lens, chamber and the regular cornea
  behind_cornea,  ///< all but the cornea
};

/// Tells each fit what the other's images say of the shape: it becomes the joint estimate of all images, with the
/// population's prior once, and what is free beside the shape follows. Exact for normal distributions; where the second fit
/// knows less than the prior, as intervals are widened for what the model does not explain, its images say nothing. Where
/// Birge's ratio R is above 1, a share 1 - 1 / R^2 of what a mixture of both spreads about the joint estimate is added to
/// the covariance (Birge 1932; of one number it is the scale factor of the Particle Data Group). What both contrasts err by
/// alike stays as it is.
void join_contrasts(EyeFit& first, EyeFit& second, Joined joined);

/// Intervals wider by the same share about what each fit says itself, where they contradict each other.
void doubt_each_other(EyeFit& first, EyeFit& second);

}  // namespace emmetrope::segmentation
