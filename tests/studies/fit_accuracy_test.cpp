// A small part of the accuracy study (docs/evidence/accuracy.md): one random head a protocol.
#include <gtest/gtest.h>

#include <cmath>

#include "meshing/biometry.hpp"
#include "tests/studies/study_eye.hpp"

namespace emmetrope::segmentation {
namespace {

using namespace meshing;

/// What no eye of a protocol may exceed: about the largest errors of the 200 eyes in docs/evidence/accuracy.md.
struct Worst {
  const char* protocol;
  unsigned long long seed;
  double axial_length_mm, M_D, J_D, retina_mm, cornea_mm;
};
std::ostream& operator<<(std::ostream& out, const Worst& worst) { return out << worst.protocol; }

/// Around the small globes of head 107 the fat, against bone, is a sharper ball than they are. In head 115 the left apex
/// begins 1.2 mm too deep.
class StudyHead : public testing::TestWithParam<Worst> {};
INSTANTIATE_TEST_SUITE_P(Accuracy, StudyHead,
                         testing::Values(Worst{"surface-coil", 115, 0.06, 1.7, 0.7, 0.012, 0.05},
                                         Worst{"head-t2", 101, 0.09, 1.9, 0.8, 0.012, 0.08},
                                         Worst{"head-t1", 107, 0.35, 3.2, 2.0, 0.12, 0.2}));

TEST_P(StudyHead, ErrorsAreOfTheTablesOrderAndWithinTheirIntervals) {
  const Worst& worst = GetParam();
  StudyProtocol protocol;
  protocol.name = worst.protocol;
  int covered = 0, of = 0;
  for (const Json& record : study_head(protocol, worst.seed)) {
    ASSERT_EQ(record.at("status"), "measured") << record.at("reasons");
    EXPECT_FALSE(record.at("irregular_cornea").get<bool>());
    const Json& truth = record.at("truth");
    const Json found = biometry_json(fitted_eye(parametric_eye_from_json(record.at("fit"))), {});
    const auto error = [&](const char* pointer) {
      const Json::json_pointer at(pointer);
      const auto measured = found.at(at).get<Measured>();
      const double e = measured.value - truth.at(at).get<double>();
      EXPECT_LT(std::abs(e), 4 * measured.sigma()) << pointer;
      covered += std::abs(e) < 1.96 * measured.sigma() ? 1 : 0;
      ++of;
      return e;
    };
    EXPECT_LT(std::abs(error("/axial_length_mm")), worst.axial_length_mm);
    EXPECT_LT(std::abs(error("/astigmatism/M_D")), worst.M_D);
    EXPECT_LT(std::hypot(error("/astigmatism/J0_D"), error("/astigmatism/J45_D")), worst.J_D);
    for (const char* other : {"/anterior_chamber_depth_mm", "/lens_thickness_mm", "/lens_anterior_radius_mm",
                              "/lens_posterior_radius_mm", "/globe_width_mm", "/globe_height_mm"})
      error(other);
    // How thick a cornea is pixels of 0.6 mm do not show: no less is unknown than before the images were seen.
    const double thickness_sigma_mm = found.at("corneal_thickness_mm").get<Measured>().sigma();
    if (worst.protocol == std::string("head-t2"))
      EXPECT_GT(thickness_sigma_mm, 0.0349);
    else
      EXPECT_LT(thickness_sigma_mm, 0.0351);
    EXPECT_LT(record.at("surface_mm").at("retina").get<double>(), worst.retina_mm);
    EXPECT_LT(record.at("surface_mm").at("cornea").get<double>(), worst.cornea_mm);
    // No interval is narrower than noise and priors allow.
    const Json& stated = record.at("fit").at("covariance");
    const Json& bound = record.at("bound");
    for (std::size_t i = 0; i < bound.size(); ++i)
      EXPECT_GT(stated[i][i].get<double>(), 0.9 * bound[i][i].get<double>()) << i;
  }
  EXPECT_GE(covered, 0.8 * of);
}

/// With fat displaced by a pixel an eye of each of these heads can be misread: a globe 2 mm too long without a fault
/// in itself, or a lens that is none. Both are right, at once or fitted again from what the fellow is like.
class DisplacedFat : public testing::TestWithParam<unsigned long long> {};
INSTANTIATE_TEST_SUITE_P(Head, DisplacedFat, testing::Values(164, 129));

TEST_P(DisplacedFat, MisleadsNoEye) {
  StudyProtocol protocol;
  protocol.name = "head-t1";
  protocol.distorted = true;
  for (const Json& record : study_head(protocol, GetParam())) {
    ASSERT_EQ(record.at("status"), "measured") << record.at("reasons");
    const Json found = biometry_json(fitted_eye(parametric_eye_from_json(record.at("fit"))), {});
    EXPECT_NEAR(found.at("axial_length_mm").at("value"), record.at("truth").at("axial_length_mm"), 0.35);
    EXPECT_NEAR(record.at("fat_shift_mm").at(0), 1, 0.25);  // one pixel, known to 0.1 of it
  }
}

/// Of a wall with a bright layer in a dark sclera a model with one brightness had the globe 0.6 mm too narrow.
TEST(Worlds, ALayeredWallIsReadAtItsInnerSide) {
  StudyProtocol protocol;
  protocol.name = "head-t1";
  protocol.world = "tissue";
  for (const Json& record : study_head(protocol, 503)) {
    ASSERT_EQ(record.at("verdict"), "measured") << record.at("reasons");
    for (const char* extent : {"globe_width_mm", "axial_length_mm"})
      EXPECT_NEAR(record.at("stated").at(extent).at("value"), record.at("truth").at(extent), 0.4) << extent;
    // In encoded slices 0.41 mm too low, which is inside the interval: docs/evidence/worlds.md, "Encoded slices".
    const auto height = record.at("stated").at("globe_height_mm").get<Measured>();
    EXPECT_LT(height.ci95[0], record.at("truth").at("globe_height_mm"));
    EXPECT_GT(height.ci95[1], record.at("truth").at("globe_height_mm"));
    // 0.36 mm for this layer, of which 0.2 had been in a bound of 0.3; the rest is held to what that left.
    EXPECT_LT(height.sigma(), std::hypot(0.36, std::sqrt(0.3 * 0.3 - 0.2 * 0.2)));
    EXPECT_GT(record.at("nuisance").at("intensity_wall_layering").get<double>(), 0.1);
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
