#include "segmentation/fit/eye_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "segmentation/fit/both_eyes.hpp"
#include "tests/support/phantom_eyes.hpp"

namespace emmetrope::segmentation {
namespace {

EyeStart start_in(const std::vector<const Stack*>& stacks) {
  const FoundEye found = find_eyes(stacks, {""}).eyes.at(0);
  return start_of(found, read_edges_of(found, stacks));
}

/// It shows the way; the eye that is found there is that of its own images, and known as well as they tell.
TEST(EyeFit, AFellowsChamberLeadsAndDoesNotHold) {
  const Stack stack = small_scan(7);
  const std::vector<const Stack*> stacks{&stack};
  EyeStart start = start_in(stacks);
  const EyeFit alone = fit_eye(stacks, start, Weighting::t2);
  start.fellow = alone.parameters;
  start.fellows_chamber_mm = alone.value(anterior_chamber_depth) + 0.4;
  const EyeFit beside = fit_eye(stacks, start, Weighting::t2);
  EXPECT_NEAR(beside.value(anterior_chamber_depth), alone.value(anterior_chamber_depth), 0.03);
  EXPECT_EQ(beside.priors.mean[anterior_chamber_depth], alone.priors.mean[anterior_chamber_depth]);
  EXPECT_EQ(beside.priors.sigma[anterior_chamber_depth], alone.priors.sigma[anterior_chamber_depth]);
  EXPECT_NEAR(beside.sigma(anterior_chamber_depth), alone.sigma(anterior_chamber_depth),
              0.05 * alone.sigma(anterior_chamber_depth));
}

/// Choroid and retina are half as bright as the vitreous in T2, muscle is darker, and fat is displaced: what is taken
/// for one wall makes the globe 0.25 mm too wide.
TEST(EyeFit, InT2TheBrightInnerLayerIsNotTakenForVitreous) {
  phantom::HeadGeometry head = phantom::random_head(7);
  for (const Laterality laterality : both_eyes) head.eye(laterality).choroid_mm = 0.4;
  const phantom::Anatomy anatomy(head);
  phantom::Protocol protocol;
  protocol.disturbances.snr = 20;
  protocol.disturbances.chemical_shift_px = 0.5;
  protocol.stacks.push_back(phantom::make_stack(
      "head-axial:pixel_mm=0.8,slice_mm=0.8,matrix=140x60,slices=44,contrast=t2", anatomy));
  const Stack stack = to_stack(phantom::render(anatomy, protocol, 0, 1), "stack1");
  const std::vector<const Stack*> stacks{&stack};
  const FoundEye found = find_eyes(stacks, {""}).eyes.at(0);
  const EyeFit fit = fit_eye(stacks, start_of(found, read_edges_of(found, stacks)), Weighting::t2);
  const phantom::EyeGeometry& truth = head.eye(found.laterality);
  EXPECT_NEAR(2 * fit.value(globe_x), 2 * truth.globe_semi_x_mm, 0.15);
  EXPECT_NEAR(fit.value(wall_layering), 0.4, 0.15);
}

/// The fit draws a nucleus of 0.62 of the lens. One of 0.8 moves the thickness by 0.03 to 0.05 mm in both eyes.
TEST(EyeFit, ALargerNucleusMovesTheLensWithinWhatIsStatedOfBothEyes) {
  phantom::HeadGeometry head = phantom::random_head(7);
  for (const Laterality laterality : both_eyes) head.eye(laterality).nucleus_share = 0.8;
  const phantom::Anatomy anatomy(head);
  phantom::Protocol protocol;
  protocol.disturbances.snr = 30;
  protocol.stacks.push_back(phantom::make_stack(
      "head-axial:pixel_mm=0.6,slice_mm=0.6,matrix=184x80,slices=56,contrast=t2", anatomy));
  const Stack stack = to_stack(phantom::render(anatomy, protocol, 0, 1), "stack1");
  const std::vector<const Stack*> stacks{&stack};
  const std::vector<FoundEye> found = find_eyes(stacks, {""}).eyes;
  ASSERT_EQ(found.size(), 2U);
  std::vector<EyeFit> fits;
  for (const FoundEye& eye : found)
    fits.push_back(fit_eye(stacks, start_of(eye, read_edges_of(eye, stacks)), Weighting::t2));
  ASSERT_TRUE(couple_eyes(fits[0], fits[1]));
  for (std::size_t e = 0; e < 2; ++e) {
    const double error_mm = fits[e].value(lens_thickness) - head.eye(found[e].laterality).lens_thickness_mm;
    EXPECT_LT(std::abs(error_mm), 1.96 * fits[e].sigma(lens_thickness)) << error_mm;
    EXPECT_LT(fits[e].sigma(lens_thickness), 0.06);
    const auto at =
        std::find(fits[e].active.begin(), fits[e].active.end(), lens_thickness) - fits[e].active.begin();
    EXPECT_NEAR(fits[e].common_covariance(at, at), 0.03 * 0.03, 1e-12) << "in images of any contrast";
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
