#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/eye_candidates.hpp"
#include "segmentation/finding/find_eyes.hpp"
#include "segmentation/finding/lens_axis.hpp"
#include "segmentation/finding/sampling.hpp"
#include "tests/support/stored_otherwise.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

struct Ball {
  Vector3d centre;
  double radius_mm;
};

/// An axial stack of balls with a wall and a lens, in fat, with air in front; noise in per cent.
Stack axial_stack(const std::vector<Ball>& balls, Weighting weighting, unsigned seed,
                  float noise_percent = 4) {
  const bool t2 = weighting == Weighting::t2;
  const double fluid = t2 ? 100 : 25, fat = t2 ? 55 : 100, lens = t2 ? 20 : 60, wall = t2 ? 20 : 45;
  Stack stack;
  stack.name = "stack1";
  stack.columns = 128;
  stack.rows = 80;
  stack.along_row = Vector3d::UnitX();
  stack.along_column = Vector3d::UnitY();
  stack.normal = Vector3d::UnitZ();
  stack.column_spacing_mm = stack.row_spacing_mm = 1;
  stack.slice_thickness_mm = 2;
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0, noise_percent);
  for (int s = 0; s < 20; ++s) {
    stack.slice_position.push_back({-64, -55, -20 + 2.0 * s});
    std::vector<float> slice;
    for (int r = 0; r < stack.rows; ++r) {
      for (int c = 0; c < stack.columns; ++c) {
        const Vector3d x = stack.slice_position.back() + Vector3d(c, r, 0);
        double value = x.y() < -46 ? 0 : fat;
        for (const Ball& ball : balls) {
          const Vector3d d = x - ball.centre;
          if (d.norm() < ball.radius_mm + 1) value = wall;
          if (d.norm() < ball.radius_mm) value = fluid;
          // Looking straight ahead, towards -y.
          const Vector3d to_lens = d - Vector3d(0, -7.3, 0);
          if (to_lens.cwiseQuotient(Vector3d(4.5, 1.9, 4.5)).norm() < 1) value = lens;
        }
        slice.push_back(std::abs(static_cast<float>(value) + noise(random)));
      }
    }
    stack.slice_intensity.push_back(std::move(slice));
  }
  return stack;
}

class BothContrasts : public testing::TestWithParam<Weighting> {};
INSTANTIATE_TEST_SUITE_P(Finding, BothContrasts, testing::Values(Weighting::t1, Weighting::t2),
                         [](const auto& of) { return std::string(to_string(of.param)); });

TEST_P(BothContrasts, PairIsFoundSidedAndLooksStraightAhead) {
  for (const unsigned seed : {1U, 2U}) {
    const Ball right{{-30.3, -33.2, 1.4}, 11.4}, left{{32.1, -32.4, 0.3}, 11.9};
    const Stack stack = axial_stack({right, left}, GetParam(), seed);
    const FoundEyes found = find_eyes({&stack}, {""});
    ASSERT_EQ(found.eyes.size(), 2U);
    EXPECT_EQ(found.eyes[0].laterality, Laterality::od);
    EXPECT_EQ(found.eyes[1].laterality, Laterality::os);
    EXPECT_TRUE(found.choices[0].used);
    for (int i = 0; i < 2; ++i) {
      const FoundEye& eye = found.eyes[i];
      const Ball& truth = i == 0 ? right : left;
      EXPECT_EQ(eye.weighting, GetParam());
      EXPECT_LT((eye.views[0].globe.centre - truth.centre).norm(), 0.6);
      // In T1 the step from wall to fat is larger than that from vitreous to wall: the wall's outside is
      // seen.
      const double seen_mm = truth.radius_mm + (GetParam() == Weighting::t1 ? 1 : 0);
      EXPECT_NEAR(eye.radius_mm, seen_mm, 0.5);
      EXPECT_GT(eye.axis.dot(-Vector3d::UnitY()), std::cos(6 * 0.0174533));
      EXPECT_GT(eye.lens_contrast, 0.15);
    }
  }
}

/// However the file stores its voxels, and whatever else it holds beyond 40 mm.
/// Silicone oil in the vitreous outshines fat in T1, and is dark in T2: the look is the other contrast's.
TEST_P(BothContrasts, OilDoesNotDecideOfAContrastThatTheHeaderTells) {
  const Ball right{{-30.3, -33.2, 1.4}, 11.4}, left{{32.1, -32.4, 0.3}, 11.9};
  Stack stack = axial_stack({right, left}, GetParam(), 1);
  const Stack of_oil = axial_stack({left}, GetParam() == Weighting::t1 ? Weighting::t2 : Weighting::t1, 1);
  for (int s = 0; s < stack.slices(); ++s)
    for (int r = 0; r < stack.rows; ++r)
      for (int c = 0; c < stack.columns; ++c)
        if ((stack.position(c, r, s) - left.centre).norm() < left.radius_mm + 1)
          stack.slice_intensity[s][static_cast<std::size_t>(r) * stack.columns + c] =
              (GetParam() == Weighting::t1 ? 1.5F : 0.5F) * of_oil.at(c, r, s);
  stack.told_weighting = GetParam();
  const FoundEyes found = find_eyes({&stack}, {""});
  ASSERT_FALSE(found.eyes.empty());
  EXPECT_EQ(found.eyes[0].laterality, Laterality::od);
  EXPECT_LT((found.eyes[0].views[0].globe.centre - right.centre).norm(), 0.6);
  for (const FoundEye& eye : found.eyes) EXPECT_EQ(eye.weighting, GetParam());
}

TEST_P(BothContrasts, AnImageThatLooksUnlikeItsHeaderIsRefusedByName) {
  Stack stack = axial_stack({{{-30.3, -33.2, 1.4}, 11.4}, {{32.1, -32.4, 0.3}, 11.9}}, GetParam(), 1);
  stack.told_weighting = GetParam() == Weighting::t1 ? Weighting::t2 : Weighting::t1;
  const FoundEyes found = find_eyes({&stack}, {""});
  EXPECT_TRUE(found.eyes.empty());
  EXPECT_THAT(found.choices[0].reason,
              testing::EndsWith(std::string("as ") + to_string(*stack.told_weighting) +
                                " shows it, which its echo, repetition and inversion times tell"));
}

TEST_P(BothContrasts, GlobesAreTheSameInEveryOrderOfTheVoxels) {
  const Stack stack = axial_stack({{{-30.3, -33.2, 1.4}, 11.4}, {{32.1, -32.4, 0.3}, 11.9}}, GetParam(), 1);
  const FoundEyes as_it_is = find_eyes({&stack}, {""});
  ASSERT_EQ(as_it_is.eyes.size(), 2U);
  // Rows end 58 mm behind the eyes; now 53 mm.
  Stack shorter = stack;
  shorter.rows -= 5;
  for (std::vector<float>& slice : shorter.slice_intensity)
    slice.resize(static_cast<std::size_t>(shorter.rows) * shorter.columns);
  for (const Stack& other :
       {stored_otherwise(stack, {{~0, 1, ~2}}), stored_otherwise(stack, {{1, ~0, 2}}), shorter}) {
    const FoundEyes found = find_eyes({&other}, {""});
    ASSERT_EQ(found.eyes.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) {
      const Vector3d &seen = found.eyes[i].views[0].globe.centre,
                     &was = as_it_is.eyes[i].views[0].globe.centre;
      EXPECT_LT((seen - was).norm(), 1e-6);
    }
  }
}

TEST_P(BothContrasts, GlobesOfAMirroredAndOfATurnedHeadAreWhereTheyWere) {
  const Stack stack = axial_stack({{{-30.3, -33.2, 1.4}, 11.4}, {{32.1, -32.4, 0.3}, 11.9}}, GetParam(), 1);
  const FoundEyes as_it_is = find_eyes({&stack}, {""});
  ASSERT_EQ(as_it_is.eyes.size(), 2U);
  const Eigen::AngleAxisd turn(0.09, Vector3d(1, 2, 3).normalized());
  const Stack mirrored = in_mirror(stack), turned = turned_header(stack, turn.angle(), turn.axis());
  const FoundEyes in_the_mirror = find_eyes({&mirrored}, {""}), in_the_turned = find_eyes({&turned}, {""});
  for (const FoundEyes* found : {&in_the_mirror, &in_the_turned}) ASSERT_EQ(found->eyes.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const FoundEye &was = as_it_is.eyes[i], &other_side = in_the_mirror.eyes[1 - i];
    const Vector3d &centre = was.views[0].globe.centre, &seen = other_side.views[0].globe.centre;
    EXPECT_LT((seen - Vector3d(-centre.x(), centre.y(), centre.z())).norm(), 1e-6);
    EXPECT_LT((other_side.axis - Vector3d(-was.axis.x(), was.axis.y(), was.axis.z())).norm(), 1e-6);
    EXPECT_LT((in_the_turned.eyes[i].views[0].globe.centre - turn * centre).norm(), 1e-6);
  }
}

/// A face's plane through both eyes has stronger edges than their walls.
TEST_P(BothContrasts, EyesAreFoundInAHeadWhoseFaceWasTakenOffThroughThem) {
  const Ball right{{-30.3, -33.2, 1.4}, 11.4}, left{{32.1, -32.4, 0.3}, 11.9};
  Stack stack = axial_stack({right, left}, GetParam(), 1);
  constexpr int blanked_rows = 22;  // to y = -33
  for (std::vector<float>& slice : stack.slice_intensity)
    std::fill_n(slice.begin(), blanked_rows * stack.columns, 0.0F);
  const FoundEyes found = find_eyes({&stack}, {""});
  ASSERT_EQ(found.eyes.size(), 2U);
  for (int i = 0; i < 2; ++i) {
    const EyeCandidate& globe = found.eyes[i].views[0].globe;
    EXPECT_LT((globe.centre - (i == 0 ? right : left).centre).norm(), 1.0);
    EXPECT_NEAR(globe.blanked, 0.5, 0.1);
  }
}

/// A file of one eye whose surroundings somebody set to zero holds one eye.
TEST_P(BothContrasts, AMaskAboutOneEyeIsNoOther) {
  const Ball left{{31, -33, 1}, 11.6};
  Stack stack = axial_stack({left}, GetParam(), 3);
  for (int s = 0; s < stack.slices(); ++s)
    for (int r = 0; r < stack.rows; ++r)
      for (int c = 0; c < stack.columns; ++c)
        if ((stack.position(c, r, s) - left.centre).cwiseAbs().maxCoeff() > 22)
          stack.slice_intensity[s][static_cast<std::size_t>(r) * stack.columns + c] = 0;
  const FoundEyes found = find_eyes({&stack}, {""});
  ASSERT_EQ(found.eyes.size(), 1U);
  EXPECT_EQ(found.eyes[0].laterality, Laterality::os);
  EXPECT_LT((found.eyes[0].views[0].globe.centre - left.centre).norm(), 1);
}

/// Displaced fat in T1 moves what is found of the globe along the eye's axis, and the lens with it.
TEST(Finding, TheLensIsFoundFromACentreThatIsOff) {
  const Ball ball{{-30.3, -33.2, 1.4}, 11.4};
  const Stack stack = axial_stack({ball}, Weighting::t1, 1);
  for (const double off_mm : {-1.8, 0.0, 1.8}) {
    const Vector3d centre = ball.centre + off_mm * Vector3d::UnitY();
    const LensAxis lens = find_lens_axis({{&stack, centre}}, ball.radius_mm + 1, Weighting::t1);
    EXPECT_GT(lens.other_axis.value_or(lens.axis).dot(-Vector3d::UnitY()), std::cos(6 * 0.0174533)) << off_mm;
  }
}

/// T1 and T2 of one person in one study: the eyes are seen in the class that says more about them, the choice
/// is explained, and the other stack changes nothing.
TEST_P(BothContrasts, OfBothTheOneThatSaysMoreIsUsed) {
  const std::vector<Ball> eyes{{{-30.3, -33.2, 1.4}, 11.4}, {{32.1, -32.4, 0.3}, 11.9}};
  const Stack better = axial_stack(eyes, GetParam(), 1, 3),
              worse = axial_stack(eyes, GetParam() == Weighting::t1 ? Weighting::t2 : Weighting::t1, 2, 9);
  const FoundEyes alone = find_eyes({&better}, {""}), together = find_eyes({&worse, &better}, {"", ""});
  ASSERT_EQ(together.eyes.size(), 2U);
  EXPECT_FALSE(together.choices[0].used);
  EXPECT_NE(together.choices[0].reason.find("says more about this eye"), std::string::npos)
      << together.choices[0].reason;
  EXPECT_TRUE(together.choices[1].used);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(together.eyes[i].weighting, GetParam());
    ASSERT_EQ(together.eyes[i].views.size(), 1U);
    EXPECT_EQ(together.eyes[i].views[0].stack, 1U);
    EXPECT_LT((together.eyes[i].views[0].globe.centre - alone.eyes[i].views[0].globe.centre).norm(), 1e-9);
  }
}

/// What a coil's correction or another scale made of a series is that acquisition, and would count twice; one more
/// acquisition of the same head counts.
TEST_P(BothContrasts, OneAcquisitionThatWasStoredTwiceCountsOnce) {
  const std::vector<Ball> eyes{{{-30.3, -33.2, 1.4}, 11.4}, {{32.1, -32.4, 0.3}, 11.9}};
  const Stack first = axial_stack(eyes, GetParam(), 1), second = axial_stack(eyes, GetParam(), 2);
  Stack corrected = first;
  corrected.name = "stack2";
  for (int s = 0; s < corrected.slices(); ++s)
    for (int r = 0; r < corrected.rows; ++r)
      for (int c = 0; c < corrected.columns; ++c) {
        float& value = corrected.slice_intensity[s][static_cast<std::size_t>(r) * corrected.columns + c];
        value *= 0.7F + 0.004F * static_cast<float>(r) + 0.002F * static_cast<float>(c);
      }
  const FoundEyes twice = find_eyes({&first, &corrected}, {"", ""}),
                  both = find_eyes({&first, &second}, {"", ""});
  ASSERT_EQ(twice.eyes.size(), 2U);
  ASSERT_EQ(both.eyes.size(), 2U);
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(twice.eyes[i].views.size(), 1U);
    ASSERT_EQ(twice.eyes[i].stored_again.size(), 1U);
    const auto [left_out, stands] = *twice.eyes[i].stored_again.begin();
    EXPECT_EQ(twice.eyes[i].views[0].stack, stands);
    EXPECT_NE(twice.choices[left_out].reason.find("one acquisition that was stored twice"), std::string::npos)
        << twice.choices[left_out].reason;
    EXPECT_EQ(both.eyes[i].views.size(), 2U);
    EXPECT_TRUE(both.eyes[i].stored_again.empty());
  }
}

TEST(Finding, OneEyeIsSaidToBeOne) {
  const Stack stack = axial_stack({{{31, -33, 1}, 11.6}}, Weighting::t2, 3);
  const FoundEyes by_place = find_eyes({&stack}, {""});
  ASSERT_EQ(by_place.eyes.size(), 1U);
  EXPECT_EQ(by_place.eyes[0].laterality, Laterality::os);
  EXPECT_EQ(by_place.notes.size(), 1U);
  EXPECT_EQ(find_eyes({&stack}, {"L"}).eyes.at(0).laterality, Laterality::os);
}

/// Of a globe on the midline (a head off the scanner's centre) only the tag can tell the side.
TEST(Finding, NearTheMidlineTheTagTellsTheSide) {
  const Stack stack = axial_stack({{{3, -33, 1}, 11.6}}, Weighting::t2, 3);
  EXPECT_EQ(find_eyes({&stack}, {"R"}).eyes.at(0).laterality, Laterality::od);
  EXPECT_EQ(find_eyes({&stack}, {"L"}).eyes.at(0).laterality, Laterality::os);
}

TEST(Finding, NearTheMidlineWithoutATagTheUserTellsTheSide) {
  for (const double x : {3.0, -3.0}) {
    const Stack stack = axial_stack({{{x, -33, 1}, 11.6}}, Weighting::t2, 3);
    try {
      find_eyes({&stack}, {""});
      FAIL() << "a side was guessed";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(error.remedy().find("--laterality"), std::string::npos);
    }
    EXPECT_EQ(find_eyes({&stack}, {""}, Laterality::od).eyes.at(0).laterality, Laterality::od);
    EXPECT_EQ(find_eyes({&stack}, {""}, Laterality::os).eyes.at(0).laterality, Laterality::os);
    EXPECT_EQ(find_eyes({&stack}, {"R"}, Laterality::os).eyes.at(0).laterality, Laterality::od);
  }
}

void expect_side_refused(const std::vector<const Stack*>& stacks, const std::vector<std::string>& tags) {
  try {
    find_eyes(stacks, tags);
    ADD_FAILURE() << "taken for the other eye";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    for (const char* says : {"stack1", "(0020,0062)", "(0020,0060)", "(0020,0032)"})
      EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << error.what();
  }
}

/// A tag against patient coordinates: no eye is measured under the other one's name.
TEST(Finding, ATagOfTheOtherSideIsRefused) {
  const Ball right{{-30.3, -33.2, 1.4}, 11.4}, left{{32.1, -32.4, 0.3}, 11.9};
  const Stack only_right = axial_stack({right}, Weighting::t2, 3),
              only_left = axial_stack({left}, Weighting::t2, 4);
  expect_side_refused({&only_left}, {"R"});
  expect_side_refused({&only_right}, {"L"});
  // Two surface coils, their tags exchanged; a stack of both eyes may be tagged for the coil's.
  expect_side_refused({&only_right, &only_left}, {"L", "R"});
  EXPECT_EQ(find_eyes({&only_right, &only_left}, {"R", "L"}).eyes.size(), 2U);
  const Stack both = axial_stack({right, left}, Weighting::t2, 5);
  const FoundEyes found = find_eyes({&both}, {"R"});
  EXPECT_EQ(found.eyes.size(), 2U);
  ASSERT_EQ(found.notes.size(), 1U);
  EXPECT_NE(found.notes.front().find("says R, but both eyes are seen"), std::string::npos);
  EXPECT_TRUE(find_eyes({&both}, {"B"}).notes.empty());
}

TEST_P(BothContrasts, AHeaderByWhichEyesLookAwayFromTheFaceIsRefused) {
  const Stack stack = axial_stack({{{-30, -33, 0}, 11.4}, {{32, -33, 0}, 11.4}}, GetParam(), 1);
  const struct {
    double by_deg;
    Vector3d about;
    const char* what;
  } headers[] = {{90, Vector3d::UnitX(), "to the head's feet"},
                 {-90, Vector3d::UnitX(), "to the head's top"},
                 {180, Vector3d::UnitX(), "to the head's back"},
                 {180, Vector3d::UnitZ(), "to the head's back"}};
  for (const auto& header : headers) {
    try {
      const Stack turned = turned_header(stack, header.by_deg * degree, header.about);
      find_eyes({&turned}, {""});
      ADD_FAILURE() << header.what;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_THAT(error.what(), testing::HasSubstr(header.what));
    }
  }
  for (const double up_or_down_deg : {-50.0, -30.0, 0.0, 30.0, 50.0}) {
    const Stack turned = turned_header(stack, up_or_down_deg * degree, Vector3d::UnitX());
    EXPECT_EQ(find_eyes({&turned}, {""}).eyes.size(), 2U) << up_or_down_deg;
  }
}

TEST(Finding, NoEyeIsInvented) {
  const Stack fat_only = axial_stack({}, Weighting::t2, 4);
  EXPECT_TRUE(find_eyes({&fat_only}, {""}).eyes.empty());
  const Stack small_balls = axial_stack({{{-30, -33, 0}, 5}, {{30, -33, 0}, 5}}, Weighting::t2, 5);
  EXPECT_TRUE(find_eyes({&small_balls}, {""}).eyes.empty());
}

TEST(Sampling, GapsAreNotInterpolated) {
  Stack stack = axial_stack({{{-30, -33, 0}, 11}}, Weighting::t2, 6);
  const Vector3d in_the_gap(-30, -33, 0.9);
  EXPECT_TRUE(Sampler(stack).interpolate(in_the_gap).has_value());
  for (const int removed : {11, 10, 9}) {
    stack.slice_position.erase(stack.slice_position.begin() + removed);
    stack.slice_intensity.erase(stack.slice_intensity.begin() + removed);
  }
  EXPECT_FALSE(Sampler(stack).interpolate(in_the_gap).has_value());
  EXPECT_NEAR(*Sampler(stack).interpolate({-30, -33, 8}), 100, 16);
}

}  // namespace
}  // namespace emmetrope::segmentation
