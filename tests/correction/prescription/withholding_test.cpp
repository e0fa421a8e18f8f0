#include "correction/prescription/withholding.hpp"

#include <gmock/gmock.h>

#include <limits>

namespace emmetrope::correction {
namespace {

Measured with_half_width(double half_width_D) { return {-2, {-2 - half_width_D, -2 + half_width_D}, "mri"}; }

TEST(Withholding, AnIntervalFromNoLensToHighMyopiaIsNoPrescription) {
  EXPECT_EQ(reason_to_withhold(with_half_width(0)), "");
  EXPECT_EQ(reason_to_withhold(with_half_width(3)), "");
  EXPECT_EQ(
      reason_to_withhold(with_half_width(3.25)),
      "The spherical equivalent's 95 % interval, +-3.25 D, is wider than from no lens at all to high myopia (6 "
      "D): these data do not support a prescription.");
  EXPECT_NE(reason_to_withhold(with_half_width(std::numeric_limits<double>::quiet_NaN())), "");
}

TEST(Withholding, AMeanOfTwoThatContradictIsNoPrescription) {
  EXPECT_EQ(reason_of_contradiction(3), "");
  EXPECT_THAT(reason_of_contradiction(4.32), testing::HasSubstr("differ by 4.3 standard deviations"));
}

TEST(Withholding, AnIntervalThatMayMakeALensWorseThanTheWornIsAnEstimate) {
  EXPECT_EQ(reason_not_to_dispense(with_half_width(1)), "");
  for (const double half_width_D : {1.25, 3.25})
    EXPECT_THAT(reason_not_to_dispense(with_half_width(half_width_D)),
                testing::HasSubstr("is wider than +-1 D: an estimate, do not dispense."));
  EXPECT_NE(reason_not_to_dispense(with_half_width(std::numeric_limits<double>::quiet_NaN())), "");
}

}  // namespace
}  // namespace emmetrope::correction
