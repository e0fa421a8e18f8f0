#include "segmentation/fit/residual_judgement.hpp"

#include <gtest/gtest.h>

#include "segmentation/fit/eye_distances.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

EyeFit fit_with_fat_displaced(Contrast contrast, double along_row_mm, double along_column_mm) {
  ParameterLayout layout;
  StackSampling sampling;
  sampling.along_row = Eigen::Vector3d::UnitX();
  sampling.along_column = -Eigen::Vector3d::UnitZ();
  sampling.normal = Eigen::Vector3d::UnitY();
  VectorXd parameters = population_mean(layout);
  parameters.segment<2>(layout.stack(0) + fat_shift_first) << along_row_mm, along_column_mm;
  const std::vector<int> active{cornea_c,       axial_length, anterior_chamber_depth,
                                lens_thickness, globe_x,      globe_y};
  const ForwardModel model(layout, {sampling}, Eigen::Vector3d::Zero());
  EyeFit fit{layout, contrast, {}, model, parameters, active, {}, {}, {}, {}, 0, {}, {}, 0, false, {}};
  fit.covariance = 1e-4 * MatrixXd::Identity(6, 6);
  return fit;
}

/// Length, width and height get a tenth of the displacement on top, in quadrature; all else stays.
TEST(DisplacedFat, AddsATenthOfItToTheGlobesIntervals) {
  const EyeFit fit = fit_with_fat_displaced(Contrast::t1, 0.6, -0.8);
  const MatrixXd by = distance_derivatives(fit);
  const VectorXd before = (by.transpose() * fit.covariance * by).diagonal(),
                 after = (by.transpose() * widened_for_displaced_fat(fit) * by).diagonal();
  for (const int distance : {pole_depth, globe_width, globe_height})
    EXPECT_NEAR(after[distance], before[distance] + 0.1 * 0.1 * 1.0, 1e-12) << distance;
  for (const int distance : {chamber_depth, lens_depth})
    EXPECT_NEAR(after[distance], before[distance], 1e-12) << distance;
  EXPECT_EQ(widened_for_displaced_fat(fit)(0, 0), fit.covariance(0, 0));  // the cornea's
}

TEST(DisplacedFat, AddsNothingInT2WhereTheWallIsTold) {
  const EyeFit fit = fit_with_fat_displaced(Contrast::t2, 0.6, -0.8);
  EXPECT_EQ(widened_for_displaced_fat(fit), fit.covariance);
}

}  // namespace
}  // namespace emmetrope::segmentation
