#include "segmentation/fit/globe_starts.hpp"

#include <gtest/gtest.h>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

/// Of a fellow whose fat is displaced by 0.8 mm towards the patient's right: sizes are the fellow's and the eye's own,
/// the globe where it was seen and, if that was the edge of fat, 0.8 mm to the left.
TEST(GlobeStarts, BesideAFellowHaveItsDisplacementOfFat) {
  Stack stack;
  stack.columns = stack.rows = 60;
  stack.along_row = Vector3d::UnitX();
  stack.along_column = Vector3d::UnitY();
  stack.normal = Vector3d::UnitZ();
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 1;
  for (int s = 0; s < 60; ++s) stack.slice_position.emplace_back(-30, -30, s - 30);
  stack.slice_intensity.assign(60, std::vector<float>(3600, 100));
  StackSampling sampling{stack.along_row, stack.along_column, stack.normal};
  sampling.fat_shift_sigma_mm = {1, 0};
  ParameterLayout layout;
  const ForwardModel model(layout, {sampling}, Vector3d::Zero());
  EyeStart start;
  start.globe_centre = Vector3d::Zero();
  start.axis = -Vector3d::UnitY();
  start.globe_half_axes_mm = Vector3d(12, 12.1, 11.9);
  start.fellow = population_mean(layout);
  start.fellow[globe_x] = 11.2;
  const int fat = layout.stack(0) + fat_shift_first;
  start.fellow[fat] = -0.8;

  const auto starts = globe_starts(model, {&stack}, start, Weighting::t1, Evidence::intensities);
  ASSERT_EQ(starts.size(), 1U);
  std::vector<std::pair<double, double>> widths_and_places;
  for (const VectorXd& a : starts[0]) {
    EXPECT_DOUBLE_EQ(a[fat], -0.8);
    widths_and_places.emplace_back(a[globe_x], a[apex_x]);
  }
  EXPECT_EQ(widths_and_places,
            (std::vector<std::pair<double, double>>{{11.2, 0}, {12, 0}, {11.2, 0.8}, {12, 0.8}}));
  EXPECT_EQ(globe_starts(model, {&stack}, start, Weighting::t2, Evidence::intensities)[0].size(), 2U);
}

}  // namespace
}  // namespace emmetrope::segmentation
