#pragma once
#include <optional>
#include <string>

#include "segmentation/judgement/judged_eye.hpp"

namespace emmetrope::segmentation {

/// fit.json: the eye with its covariance, how well it explains its images, and the gates.
/// \param head_roll_deg  angle of the line of the globes' centres against the scanner's horizontal
Json fit_json(const JudgedEye& eye, std::optional<double> head_roll_deg);

/// The figures of a fit.json that a user looks at first, as a line.
std::string summary(const Json& fit, Laterality laterality);

}  // namespace emmetrope::segmentation
