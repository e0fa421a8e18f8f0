#pragma once
#include <string>

#include "pipeline/base/measured.hpp"

namespace emmetrope::correction {

/// Why a refraction whose spherical equivalent is known so well may not stand as a prescription: it is an estimate for
/// information then.
/// \param mean_sphere_D  with its 95 % interval
/// \return one sentence; empty where it may
std::string reason_to_withhold(const Measured& mean_sphere_D);

}  // namespace emmetrope::correction
