#pragma once
#include <array>

#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Residuals by part, into the fit. \return by how much the variance of each part's samples is to be widened:
/// what the model does not explain, and neighbours whose residuals are alike, carry less information than
/// independent noise.
std::array<double, part_count> judge_residuals(EyeFit& fit, const FitProblem& problem);

}  // namespace emmetrope::segmentation
