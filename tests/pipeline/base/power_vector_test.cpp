#include "pipeline/base/power_vector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"

namespace emmetrope {
namespace {

TEST(PowerVector, WithTheRuleCylinderHasPositiveJ0) {
  // Minus cylinder at axis 180: the vertical meridian is the stronger one.
  const PowerVector vector = to_power_vector({-1, -2, 0});
  EXPECT_DOUBLE_EQ(vector.M_D, -2);
  EXPECT_NEAR(vector.J0_D, 1, 1e-15);
  EXPECT_NEAR(vector.J45_D, 0, 1e-15);
}

TEST(PowerVector, RoundTripsThroughMinusCylinder) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> sphere(-12, 12), cylinder(-6, -0.01), axis(0, 180);
  for (int i = 0; i < 1000; ++i) {
    const SpheroCylinder given{sphere(random), cylinder(random), axis(random)};
    const SpheroCylinder back = to_sphero_cylinder(to_power_vector(given));
    EXPECT_NEAR(back.sphere_D, given.sphere_D, 1e-12) << i;
    EXPECT_NEAR(back.cylinder_D, given.cylinder_D, 1e-12) << i;
    EXPECT_NEAR(std::remainder(back.axis_deg - given.axis_deg, 180.0), 0, 1e-10) << i;
    EXPECT_GE(back.axis_deg, 0);
    EXPECT_LT(back.axis_deg, 180);
  }
}

TEST(PowerVector, MovesBySphericalVertexFormula) {
  // Textbook values at 12 mm: -10 D in the spectacle is -8.9286 D at the cornea, +10 is +11.3636, -4 is
  // -3.8168.
  EXPECT_NEAR(move_towards_eye({-10, 0, 0}, 12).M_D, -8.9286, 5e-5);
  EXPECT_NEAR(move_towards_eye({+10, 0, 0}, 12).M_D, +11.3636, 5e-5);
  EXPECT_NEAR(move_towards_eye({-4, 0, 0}, 12).M_D, -3.8168, 5e-5);
}

TEST(PowerVector, MovesEachMeridianByItself) {
  const SpheroCylinder spectacle{-2, -3, 30};
  const SpheroCylinder cornea = to_sphero_cylinder(move_towards_eye(to_power_vector(spectacle), 12));
  const double along_axis = -2 / (1 + 0.012 * 2), across = -5 / (1 + 0.012 * 5);
  EXPECT_NEAR(cornea.sphere_D, along_axis, 1e-12);
  EXPECT_NEAR(cornea.sphere_D + cornea.cylinder_D, across, 1e-12);
  EXPECT_NEAR(cornea.axis_deg, 30, 1e-9);
}

TEST(PowerVector, MovingThereAndBackIsNothing) {
  const PowerVector given{-6, 1.2, -0.7};
  const PowerVector back = move_towards_eye(move_towards_eye(given, 12), -12);
  EXPECT_NEAR(back.M_D, given.M_D, 1e-12);
  EXPECT_NEAR(back.J0_D, given.J0_D, 1e-12);
  EXPECT_NEAR(back.J45_D, given.J45_D, 1e-12);
}

}  // namespace
}  // namespace emmetrope
