#include "segmentation/finding/plane_steps.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "segmentation/judgement/plane_step_gate.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Waves of 10 to 40 mm in all directions, with noise: as smooth as a head, alike everywhere.
class Waves {
 public:
  Waves() {
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    for (Wave& wave : waves_) {
      const Vector3d direction(normal(random), normal(random), normal(random));
      wave = {2 * pi / (10 + 30 * uniform(random)) * direction.normalized(), 2 * pi * uniform(random)};
    }
  }
  double operator()(const Vector3d& at) const {
    double sum = 0;
    for (const Wave& wave : waves_) sum += std::cos(wave.per_mm.dot(at) + wave.phase);
    return 1000 + 80 * sum;
  }

 private:
  struct Wave {
    Vector3d per_mm;
    double phase;
  };
  std::array<Wave, 30> waves_;
};

/// \param lost  number of the plane along an axis behind which all have moved up by one; none: negative
Stack image(const Vector3d& spacing_mm, int axis, int lost, int pixels = 80, int slices = 80) {
  static const Waves waves;
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 20);
  Stack stack;
  stack.columns = stack.rows = pixels;
  stack.along_row = Vector3d::UnitX();
  stack.along_column = Vector3d::UnitY();
  stack.normal = Vector3d::UnitZ();
  stack.column_spacing_mm = spacing_mm.x();
  stack.row_spacing_mm = spacing_mm.y();
  stack.slice_thickness_mm = spacing_mm.z();
  for (int s = 0; s < slices; ++s) {
    stack.slice_position.emplace_back(0, 0, s * spacing_mm.z());
    std::vector<float>& values = stack.slice_intensity.emplace_back();
    for (int r = 0; r < pixels; ++r)
      for (int c = 0; c < pixels; ++c) {
        std::array<int, 3> at{c, r, s};
        if (lost >= 0 && at[axis] >= lost) ++at[axis];
        const Vector3d place = Vector3d(at[0], at[1], at[2]).cwiseProduct(spacing_mm);
        values.push_back(static_cast<float>(waves(place) + noise(random)));
      }
  }
  return stack;
}

double ratio(const std::optional<PlaneStep>& step) { return step ? step->ratio : 1; }

class PlaneSteps : public testing::Test {
 protected:
  const double limit_ = limits_of("plane_step_ratio").accepted.high;
};

TEST_F(PlaneSteps, ShowWhereAPlaneIsMissing) {
  EXPECT_LT(ratio(largest_plane_step(image({1, 1, 2.5}, 2, -1), {40, 40, 100}, 12)), limit_);
  const auto step = largest_plane_step(image({1, 1, 2.5}, 2, 42), {40, 40, 100}, 12);
  ASSERT_TRUE(step);
  EXPECT_EQ(step->axis, 2);
  EXPECT_EQ(step->first, 41);
  EXPECT_GT(step->ratio, limit_);
}

TEST_F(PlaneSteps, AreSeenAlongEachAxisThatMayBeTheSlices) {
  for (const int axis : {0, 1, 2}) {
    const auto step = largest_plane_step(image({1, 1, 1}, axis, 35), {40, 40, 40}, 12);
    ASSERT_TRUE(step);
    EXPECT_EQ(step->axis, axis);
    EXPECT_EQ(step->first, 34);
    EXPECT_GT(step->ratio, limit_);
  }
  EXPECT_LT(ratio(largest_plane_step(image({1, 1, 2.5}, 0, 35), {40, 40, 100}, 12)), limit_) << "pixels";
}

TEST_F(PlaneSteps, AreLookedForAcrossTheEyeOnly) {
  EXPECT_LT(ratio(largest_plane_step(image({1, 1, 1}, 2, 62), {40, 40, 40}, 12)), limit_);
}

/// What the positions tell needs no guess.
TEST_F(PlaneSteps, AreNoGapsThatAreTold) {
  Stack stack = image({1, 1, 1}, 2, 42);
  for (int s = 42; s < stack.slices(); ++s) stack.slice_position[s].z() += 1;
  EXPECT_LT(ratio(largest_plane_step(stack, {40, 40, 40}, 12)), limit_);
}

TEST_F(PlaneSteps, AreNoneWhereAFaceWasTakenOff) {
  Stack stack = image({1, 1, 1}, 2, -1);
  for (int s = 44; s < stack.slices(); ++s)
    std::fill(stack.slice_intensity[s].begin(), stack.slice_intensity[s].end(), 0.0F);
  EXPECT_LT(ratio(largest_plane_step(stack, {40, 40, 40}, 12)), limit_);
}

/// So little is seen that it may change by chance.
TEST_F(PlaneSteps, OfACutOutAreNotTold) {
  EXPECT_FALSE(largest_plane_step(image({1, 1, 1}, 2, 20, 50, 40), {25, 25, 20}, 12));
}

TEST_F(PlaneSteps, WithholdAnEyeButForOneThatMoved) {
  const Stack stack = image({1, 1, 2.5}, 2, 42);
  EyeView view;
  view.globe.centre = {40, 40, 100};
  view.globe.radius_mm = 12;
  JudgedEye eye;
  eye.edges = {std::nullopt};
  judge_plane_steps(eye, view, stack);
  ASSERT_EQ(eye.gates.size(), 1U);
  EXPECT_EQ(eye.gates[0].withholds, Withholds::fit);
  EXPECT_NE(eye.gates[0].reason.find("between axial planes 42 and 43 of 80, counted from the patient's feet"),
            std::string::npos)
      << eye.gates[0].reason;
  EXPECT_TRUE(eye.edges.empty());
  eye.gates = {{"slice_displacement_mm", 0.6, 0.5, false, Withholds::fit, "moved"}};
  judge_plane_steps(eye, view, stack);
  EXPECT_EQ(eye.gates.size(), 1U);
  eye.gates.clear();
  judge_plane_steps(eye, view, image({1, 1, 2.5}, 2, -1));
  EXPECT_TRUE(eye.gates.empty());
}

}  // namespace
}  // namespace emmetrope::segmentation
