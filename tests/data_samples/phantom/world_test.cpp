// Worlds: heads with structures of their own, the same from the same seed, each tissue where it is said to be.
#include "data_samples/phantom/world.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "data_samples/phantom/phantom.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

HeadGeometry head_of(const std::string& world, unsigned long long seed) {
  HeadGeometry head = random_head(seed);
  furnish(head, world, seed);
  return head;
}

TEST(Worlds, MakeHeadsFromEverySeed) {
  for (const std::string& world : world_names()) {
    for (unsigned long long seed = 1; seed <= 300; ++seed)
      EXPECT_NO_THROW(check(head_of(world, seed))) << world << " " << seed;
    EXPECT_EQ(to_json(head_of(world, 7)), to_json(head_of(world, 7)));
  }
  HeadGeometry head = sample_head();
  EXPECT_THROW(furnish(head, "nowhere", 1), Error);
}

TEST(Worlds, OfTissueHaveABrightLayerInADarkScleraANucleusAndTendons) {
  const Anatomy anatomy(head_of("tissue", 3));
  for (const Laterality laterality : both_eyes) {
    const PlacedEye& eye = anatomy.eye(laterality);
    const EyeGeometry& g = eye.geometry;
    const auto at = [&](const Vector3d& p) { return anatomy.tissue_at(eye.lps_from_eye * p); };
    const double pole = pole_depth_mm(g);
    EXPECT_EQ(at({0, 0, -pole - 0.1}), Tissue::choroid);
    EXPECT_EQ(at({0, 0, -pole - g.wall_axial_mm + 0.1}), Tissue::sclera);
    const double mid_lens = g.anterior_chamber_depth_mm + g.lens_thickness_mm / 2;
    EXPECT_EQ(at({g.lens_decentre_x_mm, g.lens_decentre_y_mm, -mid_lens}), Tissue::lens_nucleus);
    EXPECT_EQ(at({g.lens_decentre_x_mm, g.lens_decentre_y_mm, -mid_lens + 0.45 * g.lens_thickness_mm}),
              Tissue::lens);
    const EyeAnatomy alone(eye);
    // On the nose's side of the globe, in the frame that turns with the head.
    const double nasal = laterality == Laterality::od ? 1 : -1;
    const double depth = eye.globe_centre_depth_mm() - 3,
                 off = alone.outer_radius_mm(depth) + g.tendon_mm / 2;
    EXPECT_EQ(anatomy.tissue_at(eye.lps_from_turned_eye() * Vector3d(nasal * off, 0, -depth)),
              Tissue::tendon);
  }
}

TEST(Worlds, OfOrbitLookWithin40DegreesAndVaryTheWall) {
  double thinnest = 10, thickest = 0;
  for (unsigned long long seed = 1; seed < 40; ++seed)
    for (const Laterality laterality : both_eyes) {
      const EyeGeometry eye = head_of("orbit", seed).eye(laterality);
      EXPECT_LE(std::hypot(eye.gaze_horizontal_deg, eye.gaze_vertical_deg), 40 + 1e-9);
    }
  const Anatomy anatomy(head_of("orbit", 5));
  const PlacedEye& eye = anatomy.eye(Laterality::od);
  const double centre = eye.globe_centre_depth_mm();
  for (int i = 0; i < 60; ++i) {
    const double angle = 0.1 * i;
    const Vector3d outward(0.8 * std::cos(angle), 0.8 * std::sin(angle), -0.6);
    double wall_mm = 0;
    for (double r = 8; r < 15; r += 0.01) {
      const Tissue tissue = anatomy.tissue_at(eye.lps_from_eye * (Vector3d(0, 0, -centre) + r * outward));
      wall_mm += tissue == Tissue::choroid || tissue == Tissue::sclera ? 0.01 : 0;
    }
    thinnest = std::min(thinnest, wall_mm);
    thickest = std::max(thickest, wall_mm);
  }
  EXPECT_GT(thickest, 1.15 * thinnest);
}

TEST(Worlds, OfOrbitGiveAPersonTwoLikeEyes) {
  const int people = 60;
  double power_D2 = 0, width_mm2 = 0;
  double flattest_D = 50, steepest_D = 30;
  for (unsigned long long seed = 1; seed <= people; ++seed) {
    const HeadGeometry head = head_of("orbit", seed);
    const auto mean_power_D = [&](const EyeGeometry& eye) {
      return keratometric_D_mm * (0.5 / eye.cornea_radius_x_mm + 0.5 / eye.cornea_radius_y_mm);
    };
    const EyeGeometry &od = head.eye(Laterality::od), &os = head.eye(Laterality::os);
    power_D2 += std::pow(mean_power_D(od) - mean_power_D(os), 2) / people;
    width_mm2 += std::pow(2 * (od.globe_semi_x_mm - os.globe_semi_x_mm), 2) / people;
    flattest_D = std::min(flattest_D, mean_power_D(od));
    steepest_D = std::max(steepest_D, mean_power_D(od));
  }
  // The population's eyes of a person share 0.95 (corneal power, sd 1.45 D) and 0.9 (globe) of a standard deviation.
  EXPECT_LT(std::sqrt(power_D2), 0.9);
  EXPECT_LT(std::sqrt(width_mm2), 0.8);
  EXPECT_LT(flattest_D, 41);
  EXPECT_GT(steepest_D, 46);
}

TEST(Worlds, OfTreatedEyesHaveOilABandAnImplantOrATumour) {
  std::set<Tissue> found;
  for (unsigned long long seed = 1; seed < 12; ++seed) {
    const Anatomy anatomy(head_of("treated", seed));
    for (const Laterality laterality : both_eyes) {
      const PlacedEye& eye = anatomy.eye(laterality);
      const double centre = eye.globe_centre_depth_mm();
      for (double x = -16; x <= 16; x += 0.8)
        for (double y = -16; y <= 16; y += 0.8)
          for (double z = -14; z <= 10; z += 0.5)
            found.insert(anatomy.tissue_at(eye.lps_from_eye * Vector3d(x, y, z - centre)));
    }
  }
  for (const Tissue tissue :
       {Tissue::silicone_oil, Tissue::silicone_rubber, Tissue::acrylic, Tissue::melanoma})
    EXPECT_EQ(found.count(tissue), 1U) << static_cast<int>(tissue);
}

TEST(Worlds, DisturbTheScannerAndNothingElse) {
  const Anatomy anatomy(head_of("console", 4));
  Protocol protocol = make_protocol("head-t2", anatomy);
  disturb(protocol, "console", 4);
  EXPECT_NE(protocol.disturbances.window, Window::none);
  EXPECT_LT(protocol.stacks[0].acquired_phase, 1);
  EXPECT_EQ(to_json(head_of("console", 4)), to_json(random_head(4)));
}

TEST(Worlds, LeaveEncodedSlicesTogether) {
  const Anatomy anatomy(head_of("scanner", 4));
  const auto disturbed = [&](const std::string& stack) {
    Protocol protocol;
    protocol.stacks = {make_stack(stack, anatomy)};
    disturb(protocol, "scanner", 4);
    return protocol.disturbances;
  };
  const Disturbances singly = disturbed("head-axial:"), together = disturbed("head-axial:profile=encoded");
  EXPECT_GT(singly.slice_gain, 0);
  EXPECT_GT(singly.slice_motion_mm, 0);
  EXPECT_EQ(together.slice_gain, 0);
  EXPECT_EQ(together.slice_motion_mm, 0);
  EXPECT_EQ(together.scale_error, singly.scale_error);
}

}  // namespace
}  // namespace emmetrope::phantom
