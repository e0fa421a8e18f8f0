#pragma once
#include "pipeline/base/json.hpp"
#include "raytrace/parametric/analytic_eye.hpp"
#include "raytrace/parametric/estimate.hpp"

namespace emmetrope {

/// optics.json: the eye as formulas and the joint distribution of what its refraction depends on.
Json optics_json(const EyeEstimate& estimate, const OpticalDefaults& defaults);

}  // namespace emmetrope
