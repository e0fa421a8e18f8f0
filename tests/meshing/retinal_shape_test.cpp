#include "meshing/retinal_shape.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <random>
#include <vector>

#include "pipeline/base/measured.hpp"
#include "pipeline/eye/parametric/retinal_metrics.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct ShapeCase {
  const char* description;
  Eigen::Vector3d semi_axes_mm;
  double times_as_uncertain;
};

/// Both ellipsoids of eyes drawn from an estimate's distribution, each measured by itself.
std::vector<std::array<BestEllipsoid, 2>> drawn_ellipsoids(const UncertainEye& estimate, int count) {
  const auto [mean, covariance] = estimate.parameters();
  const MatrixXd root = covariance.llt().matrixL();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<std::array<BestEllipsoid, 2>> ellipsoids;
  for (int k = 0; k < count; ++k) {
    const VectorXd shift = root * VectorXd::NullaryExpr(root.rows(), [&] { return normal(random); });
    const ParametricEye eye = estimate.at(mean + shift);
    const InterfaceDistance interface = vitreoretinal_interface(eye);
    ellipsoids.push_back({best_ellipsoid(interface, 120), best_ellipsoid(interface, 240)});
  }
  return ellipsoids;
}

/// Of a globe that is round but for small bulges the best ellipsoid's axis has hardly a direction: which of its axes is
/// nearest to the eye's changes from draw to draw. The intervals of its numbers hold what eyes drawn from the same
/// distribution have, and are no wider.
TEST(RetinalShape, IntervalsOfBestEllipsoidsHoldWhatDrawnEyesHave) {
  for (const ShapeCase& shape :
       {ShapeCase{"prolate", {11.2, 11.0, 12.2}, 1}, ShapeCase{"nearly round", {11.62, 11.6, 11.61}, 1},
        ShapeCase{"nearly round, poorly seen", {11.62, 11.6, 11.61}, 2}}) {
    for (const unsigned seed : {3, 21}) {
      ParametricEye eye = random_eye(seed);
      eye.globe_semi_axes_mm = shape.semi_axes_mm;
      eye.covariance *= shape.times_as_uncertain * shape.times_as_uncertain;
      const UncertainEye estimate = fitted_eye(eye);
      const Json retina = retinal_shape_json(estimate).at("retina");
      const auto drawn = drawn_ellipsoids(estimate, 400);
      const auto expect_held = [&](const char* pointer, const auto& number_of) {
        const auto told = retina.at(Json::json_pointer(pointer)).get<Measured>();
        int outside = 0;
        for (const auto& [narrow, wide] : drawn) {
          const double value = number_of(narrow, wide);
          outside += value < told.ci95[0] || value > told.ci95[1];
        }
        // 5 % of 400, to 3.4 standard deviations.
        EXPECT_NEAR(outside, 20, 15) << shape.description << ", seed " << seed << ": " << pointer;
      };
      using Best = BestEllipsoid;
      expect_held("/q_240", [](const Best&, const Best& wide) { return wide.q; });
      expect_held("/q_120", [](const Best& narrow, const Best&) { return narrow.q; });
      expect_held("/vertex_radius_mm/horizontal",
                  [](const Best&, const Best& wide) { return wide.vertex_radius_mm.x(); });
      expect_held("/vertex_radius_120_mm/vertical",
                  [](const Best& narrow, const Best&) { return narrow.vertex_radius_mm.y(); });
      expect_held("/axis_240_deg/vertical", [](const Best&, const Best& wide) { return wide.axis_deg.y(); });
      expect_held("/axis_120_deg/horizontal",
                  [](const Best& narrow, const Best&) { return narrow.axis_deg.x(); });
      expect_held("/axis_120_deg/vertical",
                  [](const Best& narrow, const Best&) { return narrow.axis_deg.y(); });
    }
  }
}

/// However well its surface is known, an eye has no front where the globe's ellipsoid has one.
TEST(RetinalShape, AnUnseenFrontIsInDepthVolumeAndArea) {
  ParametricEye eye = random_eye(3);
  eye.covariance *= 1e-8;
  const Json shape = retinal_shape_json(fitted_eye(eye));
  const auto sigma = [&](const char* pointer) {
    return shape.at(Json::json_pointer(pointer)).get<Measured>().sigma();
  };
  EXPECT_NEAR(sigma("/globe_depth_mm"), 0.6, 0.01);
  EXPECT_GT(sigma("/retina/volume_mm3"), 5);
  EXPECT_GT(sigma("/retina/area_mm2"), 5);
  EXPECT_LT(sigma("/retina/q_240"), 0.001) << "of the surface that is seen";
}

}  // namespace
}  // namespace emmetrope::meshing
