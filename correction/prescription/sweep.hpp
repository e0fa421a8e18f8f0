#pragma once
#include <string>

#include "correction/prescription/prescription.hpp"

namespace emmetrope::correction {

/// sweep.csv: radius_mm, power_D and sharpness by each criterion; one header line.
std::string sweep_csv(const PlanoCylinderResult& result);

/// The same as a picture: sharpness against radius (logarithmic), the optimum marked with its curvature, as
/// SVG text.
/// \param criterion  what the optimum is of
std::string sweep_svg(const PlanoCylinderResult& result, SharpnessCriterion criterion);

}  // namespace emmetrope::correction
