#pragma once
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// How far the corneal powers of one person's eyes differ: standard deviation of the difference (source:
/// docs/segmentation.md, "Priors").
inline constexpr double corneal_power_difference_D = 0.7;

/// Tells each eye what the other one's images say of its cornea: the fits took the eyes as strangers with the
/// population's mean corneal curvature and spread; here that prior becomes one of two eyes whose difference
/// is known. Exact for normal distributions; every parameter that goes with the curvature follows. The same
/// spread of each eye alone is kept.
/// \return false, and nothing is changed, where the eyes differ by more than three standard deviations of
/// what prior and images allow: a graft, a keratoconus of one eye
bool couple_eyes(EyeFit& od, EyeFit& os);

}  // namespace emmetrope::segmentation
