#pragma once
#include <string>

#include "pipeline/base/json.hpp"

namespace emmetrope::raytrace {

/// What a case's picture shows beside the eye that looks straight ahead at a flat field: "through a spectacle", by the
/// parameters of raytrace/stage.json; empty where nothing.
std::string seen_otherwise(const Json& trace_parameters);

}  // namespace emmetrope::raytrace
