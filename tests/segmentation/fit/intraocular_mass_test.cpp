#include "segmentation/fit/intraocular_mass.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "data_samples/phantom/anatomy.hpp"
#include "data_samples/phantom/true_optics.hpp"
#include "data_samples/phantom/truth.hpp"
#include "segmentation/output/overlay.hpp"
#include "tests/support/phantom_eyes.hpp"
#include "tests/support/pixels.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::segmentation {
namespace {

/// What a fit of one eye of a head is off by, in its standard deviations.
struct Errors {
  double length, width, height;
};
Errors errors_of(const EyeFit& fit, const Json& truth) {
  const auto off = [&](double mm, const char* what, double sigma_mm) {
    return std::abs(mm - truth.at(what).get<double>()) / sigma_mm;
  };
  return {off(to_parametric_eye(fit, Laterality::od).pole_depth_mm(), "axial_length_mm",
              fit.pole_depth_sigma_mm()),
          off(2 * fit.value(globe_x), "globe_width_mm", 2 * fit.sigma(globe_x)),
          off(2 * fit.value(globe_y), "globe_height_mm", 2 * fit.sigma(globe_y))};
}

/// Pixels of the overlay that are drawn about what is no vitreous.
int red_pixels(const EyeFit& fit) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "overlay.png";
  write_overlay(file, fit, 0);
  return test::pixels_of(file, {60, 60, 255});
}

/// Voxels of a mass that lie in the phantom's tumour.
int in_tumour(const IntraocularMass& mass, const phantom::EyeAnatomy& eye) {
  return static_cast<int>(
      std::count_if(mass.voxels.begin(), mass.voxels.end(), [&](const Eigen::Vector3d& lps) {
        phantom::Tissue tissue{};
        return eye.contains(eye.to_eye(lps), tissue) && tissue == phantom::Tissue::melanoma;
      }));
}

/// A tumour half as wide as the globe draws the wall of a fit that takes it for vitreous.
TEST(IntraocularMass, IsLeftOutOfTheFit) {
  phantom::HeadGeometry head = phantom::random_head(7);
  head.od.tumour_mm = 5;
  head.od.tumour_x_deg = 50;
  head.od.tumour_y_deg = 20;
  const Stack stack = small_scan(head);
  const std::vector<const Stack*> stacks{&stack};
  const Json truth = phantom::eye_truth(phantom::place(head, Laterality::od), head.lens_index);
  const std::vector<FoundEye> eyes = find_eyes(stacks, {""}).eyes;
  ASSERT_EQ(eyes.size(), 2U);
  for (const FoundEye& found : eyes) {
    const EyeStart start = start_of(found, read_edges_of(found, stacks));
    EyeFit fit = fit_eye_beside_mass(stacks, start, found.weighting);
    EXPECT_EQ(fit.unexplained.volume_mm3, 0);
    if (found.laterality == Laterality::os) {
      EXPECT_EQ(fit.mass.volume_mm3, 0);
      EXPECT_EQ(red_pixels(fit), 0);
      continue;
    }
    // Of half a ball of 5 mm, 262 mm3, what stands 2 mm or more from the wall.
    EXPECT_GT(fit.mass.volume_mm3, 30);
    EXPECT_LT(fit.mass.volume_mm3, 262);
    EXPECT_GT(fit.mass.over_step, 0.3);
    const auto voxels = static_cast<double>(fit.mass.voxels.size());
    EXPECT_NEAR(voxels * std::pow(0.8, 3), fit.mass.volume_mm3, 1e-6);
    EXPECT_GT(in_tumour(fit.mass, phantom::EyeAnatomy(phantom::place(head, Laterality::od))), 0.9 * voxels);
    EXPECT_GT(red_pixels(fit), 100);
    const Errors errors = errors_of(fit, truth);
    EXPECT_LT(errors.length, 3);
    EXPECT_LT(errors.width, 3);
    EXPECT_LT(errors.height, 3);
    EyeFit alone = fit_eye(stacks, start, found.weighting);
    for (EyeFit* own : {&fit, &alone}) own->covariance -= own->shared_covariance;  // which no mass moves
    EXPECT_LT(fit.pole_depth_sigma_mm(), alone.pole_depth_sigma_mm() / 2);
    EXPECT_LT(fit.stacks[0].sampling.noise, 0.8 * alone.stacks[0].sampling.noise)
        << "part of it was taken for noise";
  }
}

/// A lens is in the globe, and in no vitreous.
TEST(IntraocularMass, IsInTheVitreousOfAnotherFitBehindItsLensAndWithinItsWall) {
  const ParameterLayout layout;
  EyeFit fit{layout, Weighting::t1, {}, ForwardModel(layout, {}, Eigen::Vector3d::Zero())};
  fit.parameters = population_mean(layout);
  fit.parameters.segment<3>(apex_x) << -31, -60, 4;
  fit.parameters[gaze_horizontal] = 12;
  const Eigen::Isometry3d lps =
      lps_from_eye(fit.parameters.segment<3>(apex_x), gaze_axis(fit.value(gaze_horizontal), 0));
  const auto is_in = [&](double behind_apex_mm, double aside_mm) {
    IntraocularMass mass;
    mass.voxels.assign(3, lps * Eigen::Vector3d(aside_mm, 0, -behind_apex_mm));
    return is_in_vitreous(mass, fit);
  };
  const double lens_back_mm = fit.value(anterior_chamber_depth) + fit.value(lens_thickness),
               middle_mm = fit.value(axial_length) - fit.value(globe_z);
  EXPECT_FALSE(is_in(lens_back_mm - 0.5, 0));
  EXPECT_TRUE(is_in(lens_back_mm + 0.5, 0));
  EXPECT_TRUE(is_in(fit.value(axial_length) - 0.5, 0));
  EXPECT_FALSE(is_in(fit.value(axial_length) + 0.5, 0));
  EXPECT_TRUE(is_in(middle_mm, fit.value(globe_x) - 0.5));
  EXPECT_FALSE(is_in(middle_mm, fit.value(globe_x) + 0.5));
}

}  // namespace
}  // namespace emmetrope::segmentation
