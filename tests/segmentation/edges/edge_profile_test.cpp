#include "segmentation/edges/edge_profile.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace emmetrope::segmentation {
namespace {

/// A blurred step of height 1 at `at_mm`, on a level.
Profile blurred_step(double at_mm, double level, double sigma_mm) {
  Profile profile;
  for (int i = 0; i * profile.step_mm <= 16; ++i)
    profile.value.push_back(level +
                            0.5 * std::erfc((at_mm - i * profile.step_mm) / (sigma_mm * std::sqrt(2.0))));
  return profile;
}

TEST(FirstEdge, LiesAtTheStepByEveryRule) {
  const Profile profile = blurred_step(11.23, 0.4, 0.7);
  EdgeRule rule;
  rule.typical_step = 1;
  const auto edge = first_edge(profile, 0.4, rule);
  ASSERT_TRUE(edge);
  EXPECT_NEAR(edge->half_level_mm, 11.23,
              0.05);  // the plateau is a little below the end of a Gaussian's rise
  EXPECT_NEAR(edge->fixed_half_level_mm, 11.23, 0.005);
  EXPECT_NEAR(edge->steepest_mm, 11.23, 0.051);
  EXPECT_NEAR(edge->plateau, 1.4, 0.06);
}

TEST(FirstEdge, IsTheNearerOfTwoAndNotAFaintOne) {
  Profile profile = blurred_step(10, 0, 0.4);
  const Profile fat = blurred_step(12.5, 0, 0.4), faint = blurred_step(8.6, 0, 0.2);
  for (std::size_t i = 0; i < profile.value.size(); ++i)
    profile.value[i] += fat.value[i] + 0.1 * faint.value[i];
  EdgeRule rule;
  rule.least_rise = 0.3;
  const auto edge = first_edge(profile, 0.1, rule);
  ASSERT_TRUE(edge);
  EXPECT_NEAR(edge->half_level_mm, 10, 0.06);
}

TEST(FirstEdge, IsNoneWhereNothingRises) {
  Profile flat;
  flat.value.assign(170, 3);
  EXPECT_FALSE(first_edge(flat, 3, {}));
  Profile falling = blurred_step(11, 0, 0.5);
  for (double& value : falling.value) value = -value;
  EXPECT_FALSE(first_edge(falling, 0, {}));
}

}  // namespace
}  // namespace emmetrope::segmentation
