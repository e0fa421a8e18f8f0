#include "pipeline/eye/media/transmittance.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace emmetrope {
namespace {

double density(double nm, double age_years) { return -std::log10(ocular_transmittance(nm, age_years)); }

// Far from the lens's bands only Rayleigh's fourth power and the neutral 0.111 are left.
TEST(OcularTransmittance, RedLightLosesRayleighsShareAndTheNeutralOne) {
  for (const double age : {20.0, 70.0}) {
    const double loss_400 =
        (density(760, age) - density(840, age)) / (std::pow(400 / 760.0, 4) - std::pow(400 / 840.0, 4));
    EXPECT_NEAR(loss_400, 0.446 + 3.1e-5 * age * age, 2e-3) << age;
    EXPECT_NEAR(density(840, age) - loss_400 * std::pow(400 / 840.0, 4), 0.111, 1e-3) << age;
  }
}

// CIE 203:2012 has other constants for scatter and for the young lens, but the same growth with age: worked out by hand
// from its formula at 450 nm, 0.0619 (Rayleigh) - 0.0020 (young lens) + 0.0072 (old, UV) + 0.2222 (old).
TEST(OcularTransmittance, BlueLightIsLostWithAgeAsCie203Says) {
  EXPECT_NEAR(density(450, 60) - density(450, 20), 0.2893, 2e-4);
  EXPECT_LT(density(650, 60) - density(650, 20), 0.03);
}

TEST(OcularTransmittance, FallsTowardsBlueAndWithAge) {
  for (double nm = 400; nm < 780; nm += 5)
    for (const double age : {0.0, 20.0, 40.0, 60.0, 80.0}) {
      EXPECT_LT(ocular_transmittance(nm, age), ocular_transmittance(nm + 5, age)) << nm << ' ' << age;
      EXPECT_GT(ocular_transmittance(nm, age), ocular_transmittance(nm, age + 10)) << nm << ' ' << age;
    }
}

}  // namespace
}  // namespace emmetrope
