#include "raytrace/radiometry/observer.hpp"

#include <gtest/gtest.h>

#include "raytrace/picture/spectrum.hpp"

namespace emmetrope::raytrace {
namespace {

// CVRL's file of the same fundamentals every 1 nm, between the 5 nm that are tabulated here.
TEST(ConeFundamentals, AreThoseOfTheFinerTableBetweenTheirs) {
  const std::pair<double, Eigen::Vector3d> finer[] = {{391, {5.02650e-4, 4.48015e-4, 1.14794e-2}},
                                                      {393, {7.31850e-4, 6.58983e-4, 1.65746e-2}}};
  for (const auto& [nm, expected] : finer)
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(cone_fundamentals(nm)[k], expected[k], 0.15 * expected[k]) << nm;
}

// The CIE's luminous efficiency of 2015 is 0.68990272 L + 0.34832189 M (CIE 170-2), 1 at its peak; from V(lambda) of
// 1924 it departs by up to 0.06, most about 600 nm.
TEST(ConeFundamentals, MakeTheLuminousEfficiency) {
  double highest = 0;
  for (double nm = 390; nm <= 780; nm += 5) {
    const Eigen::Vector3d cones = cone_fundamentals(nm);
    const double efficiency = 0.68990272 * cones[0] + 0.34832189 * cones[1];
    highest = std::max(highest, efficiency);
    EXPECT_NEAR(efficiency, luminous_efficiency(nm), 0.065) << nm;
  }
  EXPECT_NEAR(highest, 1, 2e-3);
}

TEST(ConeFundamentals, PeakAtOneAndEndWhereTheyAreTabulated) {
  Eigen::Vector3d highest(0, 0, 0);
  for (double nm = 390; nm <= 830; nm += 1) highest = highest.cwiseMax(cone_fundamentals(nm));
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(highest[k], 1, 0.01);
  EXPECT_TRUE(cone_fundamentals(389.9).isZero());
  EXPECT_TRUE(cone_fundamentals(830.1).isZero());
  EXPECT_EQ(luminous_efficiency(379), 0);
  EXPECT_EQ(luminous_efficiency(555), 1);
}

// Wyman, Sloan and Shirley's fit of the CIE 1931 observer, whose y is V(lambda).
TEST(LuminousEfficiency, IsTheObserversY) {
  for (double nm = 400; nm <= 700; nm += 5)
    EXPECT_NEAR(luminous_efficiency(nm), cie_1931(nm).y(), 0.012) << nm;
}

}  // namespace
}  // namespace emmetrope::raytrace
