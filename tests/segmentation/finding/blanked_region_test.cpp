#include "segmentation/finding/blanked_region.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// 1 mm voxels about the globe's centre, which is LPS' origin; no voxel is zero but those that are blanked.
Stack noisy_stack(const std::function<bool(const Vector3d&)>& is_blank) {
  constexpr int half = 30;
  Stack stack;
  stack.columns = stack.rows = 2 * half + 1;
  stack.along_row = Vector3d::UnitX();
  stack.along_column = Vector3d::UnitY();
  stack.normal = Vector3d::UnitZ();
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 1;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> noise(1, 20);
  for (int s = -half; s <= half; ++s) {
    stack.slice_position.emplace_back(-half, -half, s);
    std::vector<float> slice;
    for (int r = -half; r <= half; ++r)
      for (int c = -half; c <= half; ++c) slice.push_back(is_blank(Vector3d(c, r, s)) ? 0 : noise(random));
    stack.slice_intensity.push_back(std::move(slice));
  }
  return stack;
}
const Vector3d ahead = -Vector3d::UnitY();  // LPS y grows backwards

TEST(BlankedRegion, HoldsWhatLiesBeforeAPlaneAndWhatReachesIntoIt) {
  const Stack stack = noisy_stack([](const Vector3d& p) { return p.y() < -6; });
  const BlankedRegion blanked(stack, Vector3d::Zero(), 20);
  EXPECT_TRUE(blanked.holds(Sampler(stack), {0, -8, 0}));
  EXPECT_FALSE(blanked.holds(Sampler(stack), {0, -4, 0}));
  EXPECT_TRUE(blanked.holds_voxel(30, 30 - 7, 30));
  EXPECT_FALSE(blanked.holds_voxel(30, 30 - 4, 30));
  EXPECT_TRUE(blanked.holds_front(stack, Vector3d::Zero(), ahead));
}

/// A cut through the chamber looks like a cornea where one ends; a lid, and air that was masked before an open eye, do not.
TEST(BlankedRegion, BeforeAnApexIsACutOnlyWhereTheBlankEndsInAPlane) {
  const auto share = [](const Stack& stack, const Vector3d& apex) {
    return BlankedRegion(stack, Vector3d::Zero(), 20).share_cut_before(stack, apex, ahead);
  };
  const Stack cut = noisy_stack([](const Vector3d& p) { return p.y() < -12; });
  EXPECT_GT(share(cut, {0, -12.3, 0}).value(), 0.9);
  EXPECT_GT(share(cut, {0, -12.7, 0}).value(), 0.9);
  EXPECT_EQ(share(cut, {0, -9, 0}).value(), 0);
  const Stack lid = noisy_stack([](const Vector3d& p) { return p.y() < -15; });  // of 2 mm, then air
  EXPECT_LT(share(lid, {0, -12.5, 0}).value(), 0.3);
  // A cornea of 7.8 mm radius without a lid, on a globe; lids cover a third of what is around it.
  const Stack open = noisy_stack([](const Vector3d& p) {
    const bool is_eye = (p - Vector3d(0, -4.7, 0)).norm() < 7.8 || p.norm() < 11.5;
    return p.y() < -4 && !is_eye && (p.y() < -12 || std::abs(p.z()) < 4.3);
  });
  EXPECT_EQ(share(open, {0, -12.5, 0}).value(), 0);
  // Slices that do not reach to the front tell nothing.
  EXPECT_FALSE(share(cut, {0, -32, 0}).has_value());
  EXPECT_EQ(BlankedRegion().share_cut_before(lid, {0, -12.5, 0}, ahead).value(), 0);
}

/// A rescale, or a normalisation, makes another value of zero.
TEST(BlankedRegion, IsKnownByTheLowestValueToo) {
  Stack stack = noisy_stack([](const Vector3d& p) { return p.y() < -6; });
  for (auto& slice : stack.slice_intensity)
    for (float& value : slice) value = 0.3F * value - 10;
  const BlankedRegion blanked(stack, Vector3d::Zero(), 20);
  const Sampler sampler(stack);
  EXPECT_TRUE(blanked.holds(sampler, {0, -8, 0}));
  EXPECT_FALSE(blanked.holds(sampler, {0, -4, 0}));
  EXPECT_TRUE(blanked.holds_front(stack, Vector3d::Zero(), ahead));
  EXPECT_TRUE(blanked.is_blank(*sampler.interpolate({0.3, -12.4, 0.2})));
  EXPECT_FALSE(blanked.is_blank(*sampler.interpolate({0.3, 4.4, 0.2})));
}

TEST(BlankedRegion, TheAirBeforeAWholeEyeIsNotItsLens) {
  const Stack stack = noisy_stack([](const Vector3d& p) { return p.y() < -14; });
  EXPECT_FALSE(BlankedRegion(stack, Vector3d::Zero(), 20).holds_front(stack, Vector3d::Zero(), ahead));
}

TEST(BlankedRegion, SingleZerosAreNoise) {
  std::mt19937 random(2);
  const Stack stack = noisy_stack([&](const Vector3d&) { return random() % 4 == 0; });
  const BlankedRegion blanked(stack, Vector3d::Zero(), 20);
  for (double y = -15; y < 15; y += 1) EXPECT_FALSE(blanked.holds(Sampler(stack), {0, y, 0})) << y;
}

/// A lens that a threshold made zero has its chamber and lid before it; negative voxels are somebody's normalisation.
TEST(BlankedRegion, ADarkLensInAWholeHeadIsNotBlanked) {
  const auto lens = [](const Vector3d& p) {
    return (p - 8 * ahead).cwiseQuotient(Vector3d(5, 3.5, 5)).norm() < 1;
  };
  Stack stack = noisy_stack(lens);
  EXPECT_TRUE(BlankedRegion(stack, Vector3d::Zero(), 20).holds(Sampler(stack), 8 * ahead));
  EXPECT_FALSE(blanked_front(stack, Vector3d::Zero(), ahead, 20).holds(Sampler(stack), 8 * ahead));
  stack = noisy_stack([](const Vector3d&) { return false; });
  for (auto& slice : stack.slice_intensity)
    for (float& value : slice) value -= 100;
  EXPECT_FALSE(BlankedRegion(stack, Vector3d::Zero(), 20).holds(Sampler(stack), 8 * ahead));
}

/// A window can make the fluid of T1 zero throughout.
TEST(BlankedRegion, DarkVitreousIsNotBlanked) {
  const Stack stack = noisy_stack([](const Vector3d& p) { return p.norm() < 11; });
  EXPECT_FALSE(BlankedRegion(stack, Vector3d::Zero(), 20).holds(Sampler(stack), {0, -8, 0}));
}

/// Most of the globe's middle is zero then, too.
TEST(BlankedRegion, APlaneBehindTheCentreTakesWhatLiesAroundTheEyeAsWell) {
  const Stack stack = noisy_stack([](const Vector3d& p) { return p.y() < 3; });
  EXPECT_TRUE(BlankedRegion(stack, Vector3d::Zero(), 20).holds_front(stack, Vector3d::Zero(), ahead));
}

}  // namespace
}  // namespace emmetrope::segmentation
