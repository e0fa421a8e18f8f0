#include "correction/optimise.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace emmetrope::correction {
namespace {

/// Sharpness of a geometric blur: the inverse of its width, best at `focus`, blurred by 0.4 D at best; as M,
/// J0 and J45 do.
SharpnessFunction blur_width(const Eigen::Vector3d& focus) {
  return [focus](const Eigen::VectorXd& lens) {
    const Eigen::Vector3d weights(1, 1.2, 0.9);
    const Eigen::Vector3d off = lens - focus;
    const double width_squared = 0.16 + off.dot(weights.cwiseProduct(off));
    return SharpnessValue{1 / std::sqrt(width_squared),
                          -std::pow(width_squared, -1.5) * weights.cwiseProduct(off)};
  };
}

Bounds box(double half_width_D) {
  return {Eigen::Vector3d::Constant(-half_width_D), Eigen::Vector3d::Constant(half_width_D)};
}

TEST(Optimise, ReachesTheOptimumFromFarInFewEvaluations) {
  const Eigen::Vector3d focus(-6.3, 1.1, -0.7);
  const Optimum optimum = climb(blur_width(focus), Eigen::Vector3d(4, 0, 0), box(20), {});
  EXPECT_TRUE(optimum.converged) << optimum.reason;
  EXPECT_LT((optimum.lens - focus).norm(), 2e-3);
  EXPECT_LE(optimum.gradient.lpNorm<Eigen::Infinity>(), 4e-3);
  EXPECT_LE(optimum.evaluations, 15);
}

TEST(Optimise, NoConvergenceAtTheIterationLimit) {
  OptimiserSettings settings;
  settings.max_iterations = 1;
  const Optimum optimum = climb(blur_width({-6, 1, 1}), Eigen::Vector3d(4, 0, 0), box(20), settings);
  EXPECT_FALSE(optimum.converged);
  EXPECT_FALSE(optimum.reason.empty());
}

TEST(Optimise, NoConvergenceWhenTheOptimumIsOutsideTheBounds) {
  const Optimum optimum = climb(blur_width({-30, 0, 0}), Eigen::Vector3d(0, 0, 0), box(20), {});
  EXPECT_GT(optimum.gradient.norm(), 0.05);  // still climbing where it had to stop
  EXPECT_FALSE(optimum.converged) << optimum.reason;
}

TEST(Optimise, NoConvergenceOnPoison) {
  const SharpnessFunction poison = [](const Eigen::VectorXd& lens) {
    return SharpnessValue{lens[0] > 1 ? NAN : lens[0] + 20, Eigen::Vector3d(1, 0, 0)};
  };
  EXPECT_FALSE(climb(poison, Eigen::Vector3d(0, 0, 0), box(20), {}).converged);
}

TEST(Optimise, CurvatureIsTheHessian) {
  const Eigen::Vector3d focus(1, 0.5, -0.5);
  const Eigen::MatrixXd hessian = curvature_of_log(blur_width(focus), focus, 0.02);
  const Eigen::Vector3d expected = -Eigen::Vector3d(1, 1.2, 0.9) / 0.16;
  EXPECT_LT((hessian - Eigen::MatrixXd(expected.asDiagonal())).cwiseAbs().maxCoeff(), 0.03);
}

}  // namespace
}  // namespace emmetrope::correction
