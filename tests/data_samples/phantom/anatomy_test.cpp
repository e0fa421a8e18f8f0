// The object that is rendered against the values that are called true.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <sstream>

#include "data_samples/phantom/phantom.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

/// Where along [low, high] `inside` turns; it must differ at the ends.
double border(const std::function<bool(double)>& inside, double low, double high) {
  const bool at_low = inside(low);
  EXPECT_NE(at_low, inside(high));
  for (int i = 0; i < 60; ++i) (inside((low + high) / 2) == at_low ? low : high) = (low + high) / 2;
  return low;
}

class RandomHeads : public testing::TestWithParam<int> {
 protected:
  HeadGeometry head = random_head(static_cast<unsigned long long>(GetParam()));
  Anatomy anatomy{head};

  Tissue at(Laterality eye, const Vector3d& p) const {
    return anatomy.tissue_at(anatomy.eye(eye).lps_from_eye * p);
  }
};

TEST_P(RandomHeads, BordersOnTheAxisAreTheTrueDepths) {
  for (const Laterality eye : both_eyes) {
    const Json truth = eye_truth(anatomy.eye(eye), head.lens_index);
    const auto on_axis = [&](Tissue tissue) {
      return [&, tissue](double depth) { return at(eye, {0, 0, -depth}) == tissue; };
    };
    const double chamber = truth["anterior_chamber_depth_mm"];
    const double lens = truth["lens_thickness_mm"];
    const double length = truth["axial_length_mm"];
    EXPECT_EQ(at(eye, {0, 0, 0.5}), Tissue::lid);
    EXPECT_NEAR(border(on_axis(Tissue::cornea), -0.5, 0.2), 0, 1e-9);
    EXPECT_NEAR(border(on_axis(Tissue::aqueous), 0.2, 1.5), truth["corneal_thickness_mm"].get<double>(),
                1e-9);
    EXPECT_NEAR(border(on_axis(Tissue::lens), 1.5, chamber + 1), chamber, 1e-9);
    EXPECT_NEAR(border(on_axis(Tissue::lens), chamber + 1, chamber + lens + 2), chamber + lens, 1e-9);
    EXPECT_NEAR(border(on_axis(Tissue::vitreous), length - 3, length + 0.4), length, 1e-9);
    EXPECT_EQ(at(eye, {0, 0, -length - 0.3}), Tissue::wall);
  }
}

TEST_P(RandomHeads, CornealMeridiansHaveTheTruePower) {
  // Axial radius at 1.5 mm from the border of cornea and lid: r sqrt(1 + 1 / slope^2).
  for (const Laterality eye : both_eyes) {
    const Json truth = eye_truth(anatomy.eye(eye), head.lens_index);
    for (const char* which : {"flat", "steep"}) {
      const double axis = truth["keratometry"][which]["axis_deg"].get<double>() * degree;
      const auto depth = [&](double r) {
        const double x = r * std::cos(axis);
        const double y = r * std::sin(axis);
        return border([&](double d) { return at(eye, {x, y, -d}) == Tissue::cornea; }, -0.4, 0.4);
      };
      const double h = 1e-3;
      const double slope = (depth(1.5 + h) - depth(1.5 - h)) / (2 * h);
      EXPECT_NEAR(1.5 * std::sqrt(1 + 1 / (slope * slope)),
                  truth["keratometry"][which]["radius_mm"].get<double>(), 1e-4);
    }
  }
}

TEST_P(RandomHeads, GlobeIsAsWideAsItsTruth) {
  for (const Laterality eye : both_eyes) {
    const PlacedEye& placed = anatomy.eye(eye);
    const Json truth = eye_truth(placed, head.lens_index);
    const auto half = [&](const Vector3d& direction) {
      const Vector3d centre(0, 0, -placed.globe_centre_depth_mm());
      return border([&](double r) { return at(eye, centre + r * direction) == Tissue::vitreous; }, 9, 13.5);
    };
    // The globe's roll against the frame tilts its widest chord by a few degrees at most.
    EXPECT_NEAR(half({1, 0, 0}) + half({-1, 0, 0}), truth["globe_width_mm"].get<double>(), 2e-3);
    EXPECT_NEAR(half({0, 1, 0}) + half({0, -1, 0}), truth["globe_height_mm"].get<double>(), 2e-3);
  }
}

TEST_P(RandomHeads, InterfaceIsWhereRetinaPointSays) {
  for (const Laterality eye : both_eyes) {
    const PlacedEye& placed = anatomy.eye(eye);
    const Vector3d centre(0, 0, -placed.globe_centre_depth_mm());
    for (int i = 0; i < 40; ++i) {
      const double polar = pi - 1.2 * (i + 0.5) / 40;
      const double around = 2.4 * i;
      const Vector3d p = retina_point(
          placed, {std::sin(polar) * std::cos(around), std::sin(polar) * std::sin(around), std::cos(polar)});
      EXPECT_EQ(at(eye, centre + 0.9999 * (p - centre)), Tissue::vitreous);
      EXPECT_EQ(at(eye, centre + 1.0001 * (p - centre)), Tissue::wall);
    }
  }
}

TEST_P(RandomHeads, AllPartsOfTheEyeAndOrbitAreThere) {
  std::array<std::size_t, tissue_count> count{};
  const Vector3d centre = anatomy.eye(Laterality::od).globe_centre_lps();
  for (double x = -25; x <= 25; x += 0.7)
    for (double y = -20; y <= 60; y += 0.7)
      for (double z = -25; z <= 35; z += 0.7)
        ++count[static_cast<std::size_t>(anatomy.tissue_at(centre + Vector3d(x, y, z)))];
  // What comes after them is of the worlds.
  for (std::size_t i = 0; i <= static_cast<std::size_t>(Tissue::white_matter); ++i)
    EXPECT_GT(count[i], 10U) << tissue_table()[i].name;
}

INSTANTIATE_TEST_SUITE_P(Population, RandomHeads, testing::Range(1, 13));

TEST(Anatomy, TurnsWithTheHead) {
  HeadGeometry head = random_head(5);
  head.roll_deg = 0;
  const Anatomy upright(head);
  const Eigen::Isometry3d before = lps_from_head(head);
  head.roll_deg = 9;
  const Anatomy rolled(head);
  const Eigen::Isometry3d rolled_from_upright = lps_from_head(head) * before.inverse();
  int different = 0;
  std::ostringstream where;
  int tissues = 0;
  for (double x = -60; x <= 60; x += 1.9)
    for (double y = -25; y <= 45; y += 1.9)
      for (double z = -25.05; z <= 30; z += 1.9) {
        const Vector3d p = before * Vector3d(x, y, z);
        const Tissue tissue = upright.tissue_at(p);
        const Tissue after = rolled.tissue_at(rolled_from_upright * p);
        if (after != tissue) {
          ++different;
          where << tissue_table()[static_cast<std::size_t>(tissue)].name << " became "
                << tissue_table()[static_cast<std::size_t>(after)].name << " at " << x << " " << y << " " << z
                << "\n";
        }
        tissues += tissue != Tissue::air ? 1 : 0;
      }
  EXPECT_GT(tissues, 10000);
  EXPECT_LT(different, 3) << where.str();  // points within rounding of a border
}

TEST(Anatomy, OpenEyeHasAirInFrontOfTheCornea) {
  HeadGeometry head = sample_head();
  head.od.lid_thickness_mm = 0;
  const Anatomy anatomy(head);
  EXPECT_EQ(anatomy.tissue_at(anatomy.eye(Laterality::od).lps_from_eye * Vector3d(0, 0, 0.1)), Tissue::air);
  EXPECT_EQ(anatomy.tissue_at(anatomy.eye(Laterality::os).lps_from_eye * Vector3d(0, 0, 0.1)), Tissue::lid);
}

TEST(Geometry, SetsFieldsByNameAndNamesWhatIsWrong) {
  HeadGeometry head;
  set_fields(head.od, "axial_length_mm=26.5,bulge_height_mm=0.7");
  EXPECT_EQ(head.od.axial_length_mm, 26.5);
  EXPECT_EQ(head.od.bulge_height_mm, 0.7);
  for (const char* wrong : {"axial_length=26", "axial_length_mm=long", "axial_length_mm"}) {
    try {
      set_fields(head.od, wrong);
      ADD_FAILURE() << wrong;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      EXPECT_NE(std::string(error.what()).find("axial_length"), std::string::npos) << error.what();
    }
  }
}

TEST(Geometry, SurvivesJson) {
  const HeadGeometry head = random_head(11);
  EXPECT_EQ(to_json(head_from_json(to_json(head))), to_json(head));
  EXPECT_THROW(head_from_json(Json{{"od", {{"axial_lenght_mm", 24}}}}), Error);
}

TEST(Geometry, RefusesEyesThatCannotBe) {
  for (const char* wrong : {"axial_length_mm=12", "cornea_radius_x_mm=3", "anterior_chamber_depth_mm=0.6",
                            "globe_semi_z_mm=13", "lens_tilt_x_deg=40", "gaze_vertical_deg=80"}) {
    HeadGeometry head = sample_head();
    set_fields(head.os, wrong);
    EXPECT_THROW(check(head), Error) << wrong;
  }
}

}  // namespace
}  // namespace emmetrope::phantom
