#pragma once
#include "pipeline/base/json.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/uncertainty/estimate.hpp"

namespace emmetrope::meshing {

/// optics.json: the eye as formulas and the joint distribution of what its refraction depends on.
Json optics_json(const EyeEstimate& estimate, const OpticalDefaults& defaults);

}  // namespace emmetrope::meshing
