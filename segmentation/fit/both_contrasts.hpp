#pragma once
#include "segmentation/fit/eye_distances.hpp"

/// One eye in images of two contrasts, each fitted with its own pose, tissues and scanner: the eye's shape is one.
namespace emmetrope::segmentation {

/// How well two fits agree: their distance that is farthest apart in standard deviations of both.
struct Agreement {
  Distance farthest = pole_depth;
  double apart_mm = 0;  ///< the first less the second
  double sigmas = 0;
  double weight_of_first = 0.5;  ///< by its precision in that distance
};
Agreement agreement_of(const EyeFit& first, const EyeFit& second);

/// Tells each fit what the other's images say of the shape (cornea, lens, globe, the wall's displacement; of a cornea with
/// a free form nothing): it becomes the joint estimate of all images, with the population's prior once, and what is free
/// beside the shape follows. Exact for normal distributions; where the second fit knows less than the prior, as intervals
/// are widened for what the model does not explain, its images say nothing. Fits that are farther apart than they say
/// leave an interval as wider as the farthest distance is standard deviations apart (Birge 1932; the scale factor of the
/// Particle Data Group): a share 1 - 1 / sigmas^2 of what a mixture of both spreads about the joint estimate is added.
void join_contrasts(EyeFit& first, EyeFit& second);

/// Intervals as much wider about what each fit says itself, where they contradict each other.
void doubt_each_other(EyeFit& first, EyeFit& second);

}  // namespace emmetrope::segmentation
