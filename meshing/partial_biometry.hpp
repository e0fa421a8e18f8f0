#pragma once
#include <string>

#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"

/// biometry.json of an eye of which not everything is known: what is not is there with the reason.
namespace emmetrope::meshing {

/// Takes the cornea's shape out.
void withhold_cornea(Json& biometry, const std::string& reason);

/// Takes cornea, chamber, lens, and what is measured from them, out: the back of the globe is left.
void withhold_front(Json& biometry, const std::string& reason);

/// Of an eye whose fit is withheld: what half-level edges tell.
/// \param fit  fit.json with "edges"
Json edge_biometry_json(const Json& fit, Laterality eye, double retinal_depth_mm);

}  // namespace emmetrope::meshing
