#pragma once
#include "pipeline/base/json.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope::meshing {

/// `globe_depth_mm` and `retina` of biometry.json, each number with its interval; docs/method/retinal-shape.md.
Json retinal_shape_json(const UncertainEye& estimate);

/// The same of an eye whose globe alone was read, as an ellipsoid: what needs more is withheld.
/// \param globe  "edges" of fit.json
Json ellipsoid_shape_json(const Json& globe, const std::string& reason);

}  // namespace emmetrope::meshing
