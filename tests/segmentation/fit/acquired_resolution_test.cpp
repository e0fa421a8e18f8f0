#include "segmentation/fit/acquired_resolution.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <random>

namespace emmetrope::segmentation {
namespace {

/// 64 x 48 x 40 voxels of white noise upon a few balls, whose columns' upper half of frequencies is set to zero.
Stack balls(bool is_filled) {
  constexpr int columns = 64, rows = 48, slices = 40;
  Stack stack;
  stack.columns = columns;
  stack.rows = rows;
  stack.along_row = {1, 0, 0};
  stack.along_column = {0, 1, 0};
  stack.normal = {0, 0, 1};
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 1;
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 3);
  for (int s = 0; s < slices; ++s) {
    cv::Mat slice(rows, columns, CV_32F);
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c) {
        const bool in_ball = std::hypot(c - 25, r - 20, s - 18) < 12,
                   in_other = std::hypot(c - 45, r - 30, s - 25) < 7;
        slice.at<float>(r, c) = 100.0F + (in_ball ? 150.0F : 0) - (in_other ? 60.0F : 0) + noise(random);
      }
    if (is_filled) {
      cv::Mat spectrum;
      cv::dft(slice, spectrum, cv::DFT_ROWS | cv::DFT_COMPLEX_OUTPUT);
      spectrum.colRange(columns / 4 + 1, columns - columns / 4).setTo(0);
      cv::dft(spectrum, slice, cv::DFT_ROWS | cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
    }
    stack.slice_position.emplace_back(0, 0, s);
    stack.slice_intensity.emplace_back(slice.begin<float>(), slice.end<float>());
  }
  return stack;
}

TEST(AcquiredResolution, OfAStackAsItWasAcquiredIsItsVoxels) {
  EXPECT_EQ(acquired_resolution(balls(false)).share, Eigen::Vector3d::Ones());
}

TEST(AcquiredResolution, OfOneWhoseKSpaceWasHalfFilledWithZerosIsHalf) {
  const AcquiredResolution resolution = acquired_resolution(balls(true));
  EXPECT_NEAR(resolution.share.x(), 0.5, 0.05);
  EXPECT_EQ(resolution.share.y(), 1);
  EXPECT_EQ(resolution.share.z(), 1);
  EXPECT_NEAR(resolution.independent(8000), 4000, 400);
}

}  // namespace
}  // namespace emmetrope::segmentation
