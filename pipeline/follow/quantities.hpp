#pragma once
#include <string>
#include <vector>

#include "pipeline/base/measured.hpp"
#include "pipeline/follow/growth.hpp"

namespace emmetrope::follow {

/// A number of an eye whose growth is told.
struct FollowedQuantity {
  const char* key;   ///< "axial_length_mm", as in biometry.json
  const char* name;  ///< "Axial length"
  const char* unit;
  int decimals;
};
const std::vector<FollowedQuantity>& followed_quantities();

/// Of an eye, in the order of followed_quantities().
Eigen::VectorXd quantities_of(const ParametricEye& eye);

/// Growth of each quantity a year, with its 95 % interval.
std::vector<Measured> growth_of_quantities(const Growth& growth);

}  // namespace emmetrope::follow
