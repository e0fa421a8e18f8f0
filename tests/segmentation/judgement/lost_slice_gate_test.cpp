// A DICOM slice that was lost: another one's pixels, or none, lie in its place.
#include "segmentation/judgement/lost_slice_gate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "segmentation/intake/lost_slices.hpp"

namespace emmetrope::segmentation {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Slices of noise, 2 mm apart, along the patient's axis.
Stack acquired_slices(int count) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> grey(0, 4000);
  Stack stack;
  stack.name = "stack1";
  stack.columns = stack.rows = 8;
  stack.along_row = Eigen::Vector3d::UnitX();
  stack.along_column = Eigen::Vector3d::UnitY();
  stack.normal = Eigen::Vector3d::UnitZ();
  stack.column_spacing_mm = stack.row_spacing_mm = 1;
  stack.slice_thickness_mm = 2;
  for (int s = 0; s < count; ++s) {
    stack.slice_position.emplace_back(0, 0, 2 * s);
    std::vector<float>& slice = stack.slice_intensity.emplace_back(64);
    for (float& value : slice) value = static_cast<float>(grey(random));
  }
  return stack;
}

EyeView eye_at(double z_mm) {
  EyeView view;
  view.globe.centre = {4, 4, z_mm};
  view.globe.radius_mm = 12;
  return view;
}

TEST(LostSlices, AreNoneOfWhatWasAcquired) {
  Stack stack = acquired_slices(20);
  EXPECT_THAT(find_lost_slices(stack), IsEmpty());
  for (const int beyond_head : {0, 1, 18, 19}) stack.slice_intensity[beyond_head].assign(64, 0);
  EXPECT_THAT(find_lost_slices(stack), IsEmpty());
}

TEST(LostSlices, AreCopiesWhereverTheyLieAndBlankedOnes) {
  Stack stack = acquired_slices(20);
  stack.slice_intensity[15] = stack.slice_intensity[4];
  stack.slice_intensity[7].assign(64, 12);
  EXPECT_THAT(find_lost_slices(stack), ElementsAre(4, 7, 15));
}

TEST(LostSlices, AreCopiesUnderAnotherScaleToo) {
  Stack stack = acquired_slices(20);
  for (std::size_t i = 0; i < 64; ++i)  // as stored in 12 bits with half of the rescale slope
    stack.slice_intensity[12][i] = std::round(0.5F * stack.slice_intensity[9][i]) + 20;
  EXPECT_THAT(find_lost_slices(stack), ElementsAre(9, 12));
  for (std::size_t i = 0; i < 64; ++i)  // what noise of one part in a hundred leaves alike is no copy
    stack.slice_intensity[12][i] = stack.slice_intensity[9][i] + (i % 2 == 0 ? 12 : -12);
  EXPECT_THAT(find_lost_slices(stack), IsEmpty());
}

TEST(LostSlices, WithholdTheEyeThatTheyCross) {
  Stack stack = acquired_slices(40);
  stack.slice_intensity[21] = stack.slice_intensity[20];
  JudgedEye eye;
  eye.edges = {std::nullopt};
  judge_lost_slices(eye, eye_at(24),
                    stack);  // to 36 mm, its cornea and wall to 39; the first of the two lies at 40 mm
  EXPECT_THAT(eye.gates, IsEmpty());
  EXPECT_EQ(eye.edges.size(), 1U);
  judge_lost_slices(eye, eye_at(26), stack);  // through its cornea alone, or its wall
  ASSERT_EQ(eye.gates.size(), 1U);
  EXPECT_FALSE(eye.gates[0].passed);
  EXPECT_EQ(eye.gates[0].withholds, Withholds::fit);
  EXPECT_EQ(eye.gates[0].value, 1);
  EXPECT_THAT(
      eye.gates[0].reason,
      HasSubstr("in place of axial plane 21 of 40, counted from the patient's feet, of stack1 stand"));
  EXPECT_THAT(eye.edges, IsEmpty());
  JudgedEye other;
  judge_lost_slices(other, eye_at(30), stack);
  ASSERT_EQ(other.gates.size(), 1U);
  EXPECT_EQ(other.gates[0].value, 2);
  EXPECT_THAT(other.gates[0].reason, HasSubstr("of stack1 (and 1 more) stand"));
}

}  // namespace
}  // namespace emmetrope::segmentation
