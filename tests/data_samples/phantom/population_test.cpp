// Random heads: plausible, reproducible, distributed as docs/method/phantom.md says.
#include <gtest/gtest.h>

#include <cmath>

#include "data_samples/phantom/phantom.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

TEST(RandomHead, OneSeedOneHead) {
  EXPECT_EQ(to_json(random_head(4)), to_json(random_head(4)));
  EXPECT_NE(to_json(random_head(4)), to_json(random_head(5)));
}

TEST(RandomHead, AllPassTheChecksAndFollowTheTable) {
  constexpr int heads = 1000;
  double chambers = 0, lids = 0;
  double length = 0, length2 = 0, power = 0, power2 = 0, both = 0, j0 = 0, thickness = 0, m = 0, m2 = 0;
  for (int seed = 0; seed < heads; ++seed) {
    const HeadGeometry head = random_head(seed);
    ASSERT_NO_THROW(check(head)) << seed;
    const EyeGeometry& od = head.od;
    const double K = (337.5 / od.cornea_radius_x_mm + 337.5 / od.cornea_radius_y_mm) / 2;
    length += od.axial_length_mm / heads;
    length2 += od.axial_length_mm * od.axial_length_mm / heads;
    power += K / heads;
    power2 += K * K / heads;
    both += (od.axial_length_mm - head.os.axial_length_mm) * (od.axial_length_mm - head.os.axial_length_mm) /
            heads;
    chambers += std::pow(od.anterior_chamber_depth_mm - head.os.anterior_chamber_depth_mm, 2) / heads;
    lids += std::pow(od.lid_thickness_mm - head.os.lid_thickness_mm, 2) / heads;
    j0 += (337.5 / od.cornea_radius_y_mm - 337.5 / od.cornea_radius_x_mm) / 2 *
          std::cos(2 * od.cornea_axis_deg * pi / 180) / heads;
    thickness += od.cornea_thickness_mm / heads;
    // A plausible refraction: a crude vergence sum, to catch impossible combinations.
    const double refraction = 1336 / (od.axial_length_mm - 1.9) - K * 0.967 - 19.5;
    m += refraction / heads;
    m2 += refraction * refraction / heads;
    const double limbus_depth = od.axial_length_mm - od.globe_semi_z_mm;
    EXPECT_GT(limbus_depth, 11) << seed;
  }
  const double standard_error = 1 / std::sqrt(heads);
  EXPECT_NEAR(length, 23.6, 4 * 1.05 * standard_error);
  EXPECT_NEAR(std::sqrt(length2 - length * length), 1.05, 0.1);
  EXPECT_NEAR(power, 43.3, 4 * 1.5 * standard_error);
  EXPECT_NEAR(std::sqrt(power2 - power * power), 1.45, 0.15);
  EXPECT_NEAR(std::sqrt(both), 1.05 * std::sqrt(2 * (1 - 0.9025)), 0.06);
  // Alike in one person, 90 % as correlation.
  EXPECT_NEAR(std::sqrt(chambers), 0.22 * std::sqrt(2 * (1 - 0.9025)), 0.02);
  EXPECT_NEAR(std::sqrt(lids), 0.3 * std::sqrt(2 * (1 - 0.9025)), 0.02);
  EXPECT_NEAR(j0, 0.30, 4 * 0.5 * standard_error);
  EXPECT_NEAR(thickness, 0.545, 4 * 0.033 * standard_error);
  EXPECT_LT(std::sqrt(m2 - m * m), 4.0);
}

TEST(RandomHead, KeratoconusIsTheSameHeadWithConesBelowTheApex) {
  for (int seed = 0; seed < 300; ++seed) {
    HeadGeometry head = random_keratoconus(seed);
    ASSERT_NO_THROW(check(head)) << seed;
    for (const Laterality laterality : both_eyes) {
      EXPECT_GT(head.eye(laterality).cone_height_um, 0);
      EXPECT_LE(head.eye(laterality).cone_y_mm, 0);
      const EyeGeometry none;
      head.eye(laterality).cone_height_um = none.cone_height_um;
      head.eye(laterality).cone_width_mm = none.cone_width_mm;
      head.eye(laterality).cone_x_mm = none.cone_x_mm;
      head.eye(laterality).cone_y_mm = none.cone_y_mm;
      head.eye(laterality).cone_back_ratio = none.cone_back_ratio;
    }
    EXPECT_EQ(to_json(head), to_json(random_head(seed)));
  }
}

TEST(RandomHead, CorneaMeetsTheGlobeAtItsLimbus) {
  for (int seed = 0; seed < 50; ++seed) {
    const EyeGeometry eye = random_head(seed).od;
    EXPECT_NEAR(eye.globe_semi_z_mm, matching_globe_semi_z_mm(eye), 1e-12);
    const double r = eye.limbus_radius_mm;
    const double radius = (eye.cornea_radius_x_mm + eye.cornea_radius_y_mm) / 2;
    const double q = (eye.cornea_q_x + eye.cornea_q_y) / 2;
    const double cornea = r * r / radius / (1 + std::sqrt(1 - (1 + q) * r * r / radius / radius));
    const double lateral = (eye.globe_semi_x_mm + eye.globe_semi_y_mm) / 2 + eye.wall_lateral_mm;
    const double globe = eye.axial_length_mm - eye.globe_semi_z_mm -
                         (eye.globe_semi_z_mm + eye.wall_axial_mm) * std::sqrt(1 - r * r / lateral / lateral);
    EXPECT_NEAR(cornea, globe, 1e-9);
  }
}

}  // namespace
}  // namespace emmetrope::phantom
