#pragma once
#include "meshing/analytic_eye.hpp"
#include "meshing/estimate.hpp"
#include "pipeline/base/json.hpp"

namespace emmetrope {

/// optics.json: the eye as formulas and the joint distribution of what its refraction depends on.
Json optics_json(const EyeEstimate& estimate, const OpticalDefaults& defaults);

}  // namespace emmetrope
