#pragma once
#include <string>
#include <vector>

#include "data_samples/phantom/acquisition.hpp"
#include "data_samples/phantom/geometry.hpp"

/// Worlds that were not drawn with the fit's model in mind: heads and scanners with families of structure that
/// it has not. docs/method/phantom.md says what is in each, and which were used to tune the fit.
namespace emmetrope::phantom {

const std::vector<std::string>& world_names();

/// What a world adds to a head, and to the way in which it is scanned; drawn from the seed, the same for the
/// same seed.
/// \throw Error (usage) for an unknown name
void furnish(HeadGeometry& head, const std::string& world, unsigned long long seed);
void disturb(Protocol& protocol, const std::string& world, unsigned long long seed);

}  // namespace emmetrope::phantom
