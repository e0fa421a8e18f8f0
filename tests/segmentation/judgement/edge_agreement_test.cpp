// What edges are worth beside a fit that has the globe elsewhere.
#include "segmentation/judgement/edge_agreement.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// A globe of these half axes about the origin of LPS, looking ahead, certain of all of it.
EyeFit globe_of(const Vector3d& half_axes_mm) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  parameters.segment<3>(globe_x) = half_axes_mm;
  parameters[apex_y] = -(parameters[axial_length] - parameters[globe_z]);
  EyeFit fit{layout, Weighting::t1, {}, ForwardModel(layout, {}, Vector3d::Zero())};
  fit.parameters = parameters;
  for (int i = 0; i < layout.size(); ++i) fit.active.push_back(i);
  fit.covariance = Eigen::MatrixXd::Zero(layout.size(), layout.size());
  return fit;
}

ReadEye read_at(const Vector3d& centre, double width_mm, double height_mm) {
  ReadEye read;
  read.reading.globe.centre = centre;
  read.biometry.globe_width = {width_mm, 0.6};
  read.biometry.globe_height = {height_mm, 0.6};
  read.biometry.globe_depth = {23, 0.6};
  return read;
}

TEST(EdgesInDoubt, ReachToAFitThatHasTheBorderElsewhere) {
  const EyeFit fit = globe_of({11.5, 11.5, 11.5});
  const EdgeBiometry doubted = with_doubt(read_at(Vector3d::Zero(), 26.2, 23.4), fit);
  // 3.2 mm apart: half of it on top of the edges' own deviation.
  EXPECT_DOUBLE_EQ(doubted.globe_width.value, 26.2);
  EXPECT_NEAR(doubted.globe_width.sigma, std::hypot(0.6, 1.6), 1e-12);
  EXPECT_NEAR(doubted.globe_height.sigma, 0.6, 1e-12);  // these agree
}

TEST(EdgesInDoubt, AGlobeElsewhereOrNoGlobeTellsNothingOfThem) {
  const EyeFit fit = globe_of({11.5, 11.5, 11.5});
  EXPECT_DOUBLE_EQ(with_doubt(read_at({8, 0, 0}, 26.2, 23.4), fit).globe_width.sigma, 0.6);
  EXPECT_DOUBLE_EQ(with_doubt(read_at(Vector3d::Zero(), 26.2, 23.4), globe_of({7, 7, 7})).globe_width.sigma,
                   0.6);
}

/// By the 95 % quantiles of the normal distribution (lengths) and of the chi distribution with three degrees of freedom
/// (a place; its rms is the root of three deviations).
TEST(LabelsBesideEdges, DifferBeyondTheIntervalsOfBoth) {
  const EyeFit drawn = globe_of({11.5, 11.5, 11.5});
  const auto over = [&](const Vector3d& centre, double width_mm) {
    ReadEye read = read_at(centre, width_mm, 23);
    read.biometry.centre.sigma = 0.4;
    return compare_labels_with_edges(drawn, read);
  };
  EXPECT_NEAR(over({0, 0, 1.2}, 23).over_ci95, 1.2 / (std::sqrt(7.815) * 0.4), 1e-3);
  EXPECT_GT(over({0, 0, 1.2}, 23).over_ci95, 1);
  EXPECT_EQ(over({0, 0, 1.2}, 23).largest, "the globe's centres lie 1.2 mm apart");
  EXPECT_NEAR(over({0, 0, 0}, 24.3).over_ci95, 1.3 / (1.96 * 0.6), 1e-9);
  EXPECT_EQ(over({0, 0, 0}, 24.3).largest, "width 23.0 mm, by the edges 24.3 mm");
  EXPECT_LT(over({0, 0, 0.9}, 24).over_ci95, 1);
}

}  // namespace
}  // namespace emmetrope::segmentation
