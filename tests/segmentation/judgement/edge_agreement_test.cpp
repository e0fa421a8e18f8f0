// What edges are worth beside a fit that has the globe elsewhere.
#include "segmentation/judgement/edge_agreement.hpp"

#include <gtest/gtest.h>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// A globe of these half axes about the origin of LPS, looking ahead.
EyeFit globe_of(const Vector3d& half_axes_mm) {
  const ParameterLayout layout;
  Eigen::VectorXd parameters = population_mean(layout);
  parameters.segment<3>(globe_x) = half_axes_mm;
  parameters[apex_y] = -(parameters[axial_length] - parameters[globe_z]);
  EyeFit fit{layout, Weighting::t1, {}, ForwardModel(layout, {}, Vector3d::Zero())};
  fit.parameters = parameters;
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

}  // namespace
}  // namespace emmetrope::segmentation
