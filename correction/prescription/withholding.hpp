#pragma once
#include <string>

#include "pipeline/base/measured.hpp"

namespace emmetrope::correction {

/// Why a refraction whose spherical equivalent is known so well may not stand as a prescription: it is an estimate for
/// information then.
/// \param mean_sphere_D  with its 95 % interval
/// \return one sentence; empty where it may
std::string reason_to_withhold(const Measured& mean_sphere_D);

/// Why what is combined from the images and a refraction so far from them may not.
/// \param innovation_sigma  Calibration::innovation_sigma
/// \return one sentence; empty where it may
std::string reason_of_contradiction(double innovation_sigma);

/// Why its lens is not to be dispensed without a refraction, withheld or not.
/// \return one sentence; empty where nothing is to be said
std::string reason_not_to_dispense(const Measured& mean_sphere_D);

}  // namespace emmetrope::correction
