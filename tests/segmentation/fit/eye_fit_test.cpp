#include "segmentation/fit/eye_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/phantom_eyes.hpp"

namespace emmetrope::segmentation {
namespace {

EyeStart start_in(const std::vector<const Stack*>& stacks) {
  const FoundEye found = find_eyes(stacks, {""}).eyes.at(0);
  return start_of(found, read_edges_of(found, stacks));
}

/// It shows the way; the eye that is found there is that of its own images, and known as well as they tell.
TEST(EyeFit, AFellowsChamberLeadsAndDoesNotHold) {
  const Stack stack = small_scan(7);
  const std::vector<const Stack*> stacks{&stack};
  EyeStart start = start_in(stacks);
  const EyeFit alone = fit_eye(stacks, start, Weighting::t2);
  start.fellow = alone.parameters;
  start.fellows_chamber_mm = alone.value(anterior_chamber_depth) + 0.4;
  const EyeFit beside = fit_eye(stacks, start, Weighting::t2);
  EXPECT_NEAR(beside.value(anterior_chamber_depth), alone.value(anterior_chamber_depth), 0.03);
  EXPECT_EQ(beside.priors.mean[anterior_chamber_depth], alone.priors.mean[anterior_chamber_depth]);
  EXPECT_EQ(beside.priors.sigma[anterior_chamber_depth], alone.priors.sigma[anterior_chamber_depth]);
  EXPECT_NEAR(beside.sigma(anterior_chamber_depth), alone.sigma(anterior_chamber_depth),
              0.05 * alone.sigma(anterior_chamber_depth));
}

}  // namespace
}  // namespace emmetrope::segmentation
