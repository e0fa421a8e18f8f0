#pragma once
#include "pipeline/base/json.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope::meshing {

/// optics.json: the eye as formulas and the joint distribution of what its refraction depends on.
Json optics_json(const UncertainEye& estimate, const OpticalDefaults& defaults);

}  // namespace emmetrope::meshing
