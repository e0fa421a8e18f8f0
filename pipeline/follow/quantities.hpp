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
  bool is_of_cornea = false;
};
const std::vector<FollowedQuantity>& followed_quantities();

/// Of an eye, in the order of followed_quantities().
Eigen::VectorXd quantities_of(const ParametricEye& eye);

/// Growth of each quantity a year, with its 95 % interval.
std::vector<Measured> growth_of_quantities(const Growth& growth);

/// By how much a quantity of a later visit's fit differs from the first's.
struct Difference {
  double value = 0;
  double sigma = 0;  ///< standard deviation that the errors of both fits and the change of an eye give it
};
/// Of each later visit, in the order of followed_quantities().
std::vector<std::vector<Difference>> differences_of_quantities(const Growth& growth);

}  // namespace emmetrope::follow
