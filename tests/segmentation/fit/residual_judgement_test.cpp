#include "segmentation/fit/residual_judgement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "segmentation/fit/eye_distances.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

EyeFit fit_with_fat_displaced(Weighting weighting, double along_row_mm, double along_column_mm) {
  ParameterLayout layout;
  StackSampling sampling;
  sampling.along_row = Eigen::Vector3d::UnitX();
  sampling.along_column = -Eigen::Vector3d::UnitZ();
  sampling.normal = Eigen::Vector3d::UnitY();
  sampling.row_cutoff_per_mm = 0.5 / 0.9;
  sampling.column_cutoff_per_mm = 0.5 / 1.2;
  VectorXd parameters = population_mean(layout);
  parameters.segment<2>(layout.stack(0) + fat_shift_first) << along_row_mm, along_column_mm;
  const ForwardModel model(layout, {sampling}, Eigen::Vector3d::Zero());
  EyeFit fit{layout, weighting, {}, model};
  fit.parameters = parameters;
  fit.active = {cornea_c, axial_length, anterior_chamber_depth, lens_thickness, globe_x, globe_y};
  fit.covariance = 1e-4 * MatrixXd::Identity(6, 6);
  return fit;
}

/// Of a first-order process of this correlation.
TEST(ResidualCorrelation, OfManyPairsIsThatOfTheProcess) {
  EXPECT_NEAR(voxels_per_independent(0.5, 1e6), 3, 1e-4);
  EXPECT_EQ(voxels_per_independent(-0.3, 1e6), 1);
  EXPECT_EQ(voxels_per_independent(0, 0), 1);
}

/// Correlations of 100 independent pairs, of which the positive half would make 1.09 on average: the mean of
/// (1 + r) / (1 - r) over a normal r of 0.1 where it is positive, and 1 elsewhere.
TEST(ResidualCorrelation, OfFewIndependentPairsIsNearlyNone) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> chance(0, 0.1);
  double mean = 0, as_seen = 0;
  for (int i = 0; i < 20000; ++i) {
    const double correlation = chance(random);
    mean += voxels_per_independent(correlation, 100) / 20000;
    as_seen += voxels_per_independent(correlation, 1e9) / 20000;
  }
  EXPECT_NEAR(as_seen, 1.09, 0.01);
  EXPECT_LT(mean, 1.05);
}

/// Length, width and height get 0.06 of the displacement on top, and 0.025 coarsest pixels for every
/// interface that ends them, in quadrature; all else stays.
TEST(FaintWall, WidensTheGlobesIntervals) {
  const EyeFit fit = fit_with_fat_displaced(Weighting::t1, 0.6, -0.8);
  const MatrixXd by = distance_derivatives(fit);
  const VectorXd before = (by.transpose() * fit.covariance * by).diagonal(),
                 after = (by.transpose() * widened_for_faint_wall(fit) * by).diagonal();
  for (const int distance : {pole_depth, globe_width, globe_height})
    EXPECT_NEAR(after[distance],
                before[distance] + std::pow(0.06 * 1.0, 2) +
                    std::pow((distance == pole_depth ? 1 : 2) * 0.025 * 1.2, 2),
                1e-12)
        << distance;
  for (const int distance : {chamber_depth, lens_depth})
    EXPECT_NEAR(after[distance], before[distance], 1e-12) << distance;
  EXPECT_EQ(widened_for_faint_wall(fit)(0, 0), fit.covariance(0, 0));  // the cornea's
}

TEST(FaintWall, AddsNothingInT2) {
  const EyeFit fit = fit_with_fat_displaced(Weighting::t2, 0.6, -0.8);
  EXPECT_EQ(widened_for_faint_wall(fit), fit.covariance);
}

}  // namespace
}  // namespace emmetrope::segmentation
