#include "pipeline/base/frames.hpp"

#include <gtest/gtest.h>

#include <random>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

TEST(EyeFrame, LooksForwardAsTheStandardSays) {
  // A patient looking straight ahead: out of the eye is anterior (-y in LPS), x is the patient's left, y is
  // up.
  const Eigen::Isometry3d frame = lps_from_eye({30, -60, 10}, {0, -1, 0});
  EXPECT_TRUE(frame.linear().col(0).isApprox(Eigen::Vector3d(1, 0, 0)));
  EXPECT_TRUE(frame.linear().col(1).isApprox(Eigen::Vector3d(0, 0, 1)));
  EXPECT_TRUE(frame.linear().col(2).isApprox(Eigen::Vector3d(0, -1, 0)));
  EXPECT_TRUE((frame * Eigen::Vector3d::Zero()).isApprox(Eigen::Vector3d(30, -60, 10)));
}

TEST(EyeFrame, IsRightHandedWithHorizontalXForAnyGaze) {
  std::mt19937 random(2);
  std::normal_distribution<double> sideways(0, 0.5);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Isometry3d frame = lps_from_eye({0, 0, 0}, {sideways(random), -1, sideways(random)});
    EXPECT_NEAR(frame.linear().determinant(), 1, 1e-12) << i;
    EXPECT_NEAR(frame.linear()(2, 0), 0, 1e-12) << i;  // x has no superior component
    EXPECT_GT(frame.linear()(0, 0), 0) << i;           // x to the patient's left
    EXPECT_GT(frame.linear()(2, 1), 0) << i;           // y up
  }
}

TEST(EyeFrame, RefusesAVerticalAxis) { EXPECT_THROW(lps_from_eye({0, 0, 0}, {0, 0, 1}), Error); }

TEST(EyeFrame, RoundTripsThroughJson) {
  const Eigen::Isometry3d frame = lps_from_eye({1.25, -3, 8}, {0.1, -1, -0.2});
  EXPECT_TRUE(isometry_from_json(to_json_matrix(frame)).isApprox(frame, 1e-15));
}

TEST(EyeFrame, RefusesAMirrorAndAScale) {
  Json mirrored = to_json_matrix(Eigen::Isometry3d::Identity());
  mirrored[0][0] = -1;
  EXPECT_THROW(isometry_from_json(mirrored), Error);
  Json scaled = to_json_matrix(Eigen::Isometry3d::Identity());
  scaled[1][1] = 1.01;
  EXPECT_THROW(isometry_from_json(scaled), Error);
  EXPECT_THROW(isometry_from_json(Json::array({1, 2, 3})), Error);
}

TEST(Axis, IsFrom0To180) {
  EXPECT_DOUBLE_EQ(normalise_axis_deg(180), 0);
  EXPECT_DOUBLE_EQ(normalise_axis_deg(-10), 170);
  EXPECT_DOUBLE_EQ(normalise_axis_deg(725), 5);
  EXPECT_LT(normalise_axis_deg(-1e-18), 180);
}

}  // namespace
}  // namespace emmetrope
