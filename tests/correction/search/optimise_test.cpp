#include "correction/search/optimise.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "correction/search/lens_family.hpp"

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
  OptimiserSettings settings;
  settings.from_afar = true;
  const Optimum optimum = ascend(blur_width(focus), Eigen::Vector3d(4, 0, 0), box(20), settings);
  EXPECT_TRUE(optimum.converged) << optimum.reason;
  EXPECT_LT((optimum.lens - focus).norm(), 2e-3);
  EXPECT_LE(optimum.gradient.lpNorm<Eigen::Infinity>(), 4e-3);
  EXPECT_LE(optimum.evaluations, 15);
}

TEST(Optimise, NoConvergenceAtTheIterationLimit) {
  OptimiserSettings settings;
  settings.max_iterations = 1;
  const Optimum optimum = ascend(blur_width({-6, 1, 1}), Eigen::Vector3d(4, 0, 0), box(20), settings);
  EXPECT_FALSE(optimum.converged);
  EXPECT_EQ(optimum.reason.find("sharpness still changes by"), 0U) << optimum.reason;
}

TEST(Optimise, NoConvergenceWhenTheOptimumIsOutsideTheBounds) {
  const Optimum optimum = ascend(blur_width({-30, 0, 0}), Eigen::Vector3d(0, 0, 0), box(20), {});
  EXPECT_GT(optimum.gradient.norm(), 0.05);  // still rising where it had to stop
  EXPECT_FALSE(optimum.converged) << optimum.reason;
}

TEST(Optimise, NoConvergenceOnPoison) {
  const SharpnessFunction poison = [](const Eigen::VectorXd& lens) {
    return SharpnessValue{lens[0] > 1 ? NAN : lens[0] + 20, Eigen::Vector3d(1, 0, 0)};
  };
  EXPECT_FALSE(ascend(poison, Eigen::Vector3d(0, 0, 0), box(20), {}).converged);
}

TEST(Optimise, CurvatureIsTheHessian) {
  const Eigen::Vector3d focus(1, 0.5, -0.5);
  const SharpnessFunction sharpness = blur_width(focus);
  const Eigen::Vector3d weights(1, 1.2, 0.9);
  // Beside the maximum, as a search ends.
  for (const Eigen::Vector3d& off : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.02, -0.01, 0.01)}) {
    Optimum optimum;
    optimum.lens = focus + off;
    const SharpnessValue value = sharpness(optimum.lens);
    optimum.gradient = value.gradient / value.value;
    const Eigen::MatrixXd hessian = curvature_of_log(sharpness, optimum);
    // ln S = -ln(0.16 + off' W off) / 2; its gradient -W off / (0.16 + off' W off) between the two places.
    const auto log_gradient = [&](const Eigen::Vector3d& d) -> Eigen::Vector3d {
      return -weights.cwiseProduct(d) / (0.16 + d.dot(weights.cwiseProduct(d)));
    };
    Eigen::Matrix3d quotients;
    for (int i = 0; i < 3; ++i)
      quotients.col(i) = (log_gradient(off + 0.05 * Eigen::Vector3d::Unit(i)) - log_gradient(off)) / 0.05;
    EXPECT_LT((hessian - (quotients + quotients.transpose()) / 2).cwiseAbs().maxCoeff(), 1e-9);
    const Eigen::Matrix3d exact = -Eigen::Matrix3d(weights.asDiagonal()) / 0.16;
    EXPECT_LT((hessian - exact).cwiseAbs().maxCoeff(), 0.06 * 1.2 / 0.16);
  }
}

TEST(Optimise, CurvatureOfAFlatSummitIsNotItsNoise) {
  // As through a wide pupil: slopes that change by 0.1 per dioptre, and by up to 0.002 from ray to ray.
  constexpr double curvature = -0.1, noise = 0.002, long_step_D = 0.25;
  const SharpnessFunction sharpness = [&](const Eigen::VectorXd& lens) {
    const double value = std::exp(curvature / 2 * lens.squaredNorm());
    const Eigen::VectorXd slope = curvature * lens.array() + noise * (1000 * lens.array()).cos();
    return SharpnessValue{value, value * slope};
  };
  Optimum optimum;
  optimum.lens = Eigen::Vector3d::Zero();
  optimum.gradient = sharpness(optimum.lens).gradient;
  const Eigen::MatrixXd error =
      curvature_of_log(sharpness, optimum) - curvature * Eigen::Matrix3d::Identity();
  EXPECT_LE(error.cwiseAbs().maxCoeff(), 2 * noise / long_step_D + 1e-12);
}

/// A cylinder's sharpness: best at `focus`, falls fast with its power and hardly with its axis.
SharpnessValue ridge(const Eigen::Vector2d& at, double focus, double axis_weight) {
  const double radius = at.norm(), angle = std::atan2(at[1], at[0]);
  const double off = radius - focus, width_squared = 1 + 10 * off * off + axis_weight * angle * angle;
  const Eigen::Vector2d along = at / radius, across(-along[1], along[0]);
  const Eigen::Vector2d slope = 10 * off * along + axis_weight * angle / radius * across;
  return {1 / std::sqrt(width_squared), -std::pow(width_squared, -1.5) * slope};
}

TEST(Optimise, ARoundRidgeIsAscendedInPolarForm) {
  // The same ridge in J0 and J45, where it is bent, and in power and arc.
  constexpr double focus = 2.5, axis_weight = 0.05;
  const double start_angle = 0.5;
  const Eigen::Vector2d start = 2 * Eigen::Vector2d(std::cos(start_angle), std::sin(start_angle));
  const Bounds bounds{Eigen::Vector2d(-15, -15), Eigen::Vector2d(15, 15)};
  const LensFamily bent{"ridge", bounds, nullptr, [](const Eigen::VectorXd& lens) {
                          return PowerVector{lens.norm(), lens[0], lens[1]};
                        }};
  const LensFamily straight = polar(bent, start);
  const auto in_polar = [&](const Eigen::VectorXd& lens) {
    const PowerVector power = straight.power(lens);
    const Eigen::Vector2d at(power.J0_D, power.J45_D);
    const SharpnessValue value = ridge(at, focus, axis_weight);
    const Eigen::Vector2d along = at / at.norm(), across(-along[1], along[0]);
    return SharpnessValue{value.value, Eigen::Vector2d(value.gradient.dot(along),
                                                       value.gradient.dot(across) * lens[0] / start.norm())};
  };
  const auto in_components = [&](const Eigen::VectorXd& lens) { return ridge(lens, focus, axis_weight); };
  const Optimum by_polar = ascend(in_polar, Eigen::Vector2d(2, 0), straight.bounds, {});
  const Optimum by_components = ascend(in_components, start, bounds, {});
  ASSERT_TRUE(by_polar.converged && by_components.converged);
  const PowerVector found = straight.power(by_polar.lens);
  EXPECT_NEAR(found.M_D, focus, 1e-3);
  EXPECT_NEAR(std::atan2(found.J45_D, found.J0_D), 0, 0.02);
  EXPECT_GT(by_polar.sharpness, by_components.sharpness - 1e-6);
  EXPECT_LT(by_polar.evaluations, by_components.evaluations);
}

TEST(Optimise, FirstStepIsNewtonsOnAParabolaOfTheInverseSquare) {
  // 1/S^2 = 1.5 + (x / 0.7)^2: aberrated at best, from nine depths of focus away.
  int evaluations = 0;
  const SharpnessFunction sharpness = [&](const Eigen::VectorXd& lens) {
    ++evaluations;
    const double inverse_square = 1.5 + lens[0] * lens[0] / 0.49;
    return SharpnessValue{1 / std::sqrt(inverse_square),
                          Eigen::VectorXd::Constant(1, -std::pow(inverse_square, -1.5) * lens[0] / 0.49)};
  };
  OptimiserSettings settings;
  settings.depth_of_focus_D = 0.7;
  settings.from_afar = true;
  const Bounds bounds{Eigen::VectorXd::Constant(1, -20), Eigen::VectorXd::Constant(1, 20)};
  const Optimum optimum = ascend(sharpness, Eigen::VectorXd::Constant(1, 6), bounds, settings);
  EXPECT_TRUE(optimum.converged);
  EXPECT_NEAR(optimum.lens[0], 0, 1e-9);
  EXPECT_LE(evaluations, 2);
}

}  // namespace
}  // namespace emmetrope::correction
