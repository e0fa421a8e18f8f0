#include "segmentation/fit/both_eyes.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

namespace emmetrope::segmentation {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix4d;
using Eigen::Vector2d;
using Eigen::Vector4d;
using Eigen::VectorXd;

constexpr double per_dioptre = 1 / 337.5;
constexpr double chamber_sigma_mm = 0.6;

/// What the images of one eye say of corneal curvature and chamber depth: a mean with an information matrix.
struct Images {
  Vector2d mean;
  Matrix2d information;
};
Images images(double power_D, double sigma_D, double chamber_mm) {
  const double c = sigma_D * per_dioptre, d = 0.03, correlation = 0.6;
  Matrix2d covariance;
  covariance << c * c, correlation * c * d, correlation * c * d, d * d;
  return {{power_D * per_dioptre, chamber_mm}, covariance.inverse()};
}

/// A fit of these two parameters to the images and the priors of a stranger's eye.
EyeFit fit_of(const Images& seen) {
  const ParameterLayout layout;
  const VectorXd mean = population_mean(layout);
  EyeFit fit{layout, Contrast::t2,
             {},     ForwardModel(layout, {}, Eigen::Vector3d::Zero()),
             mean,   {},
             {},     population_priors(layout, mean, Contrast::t2),
             {},     {},
             0,      {},
             {},     0,
             true,   {}};
  fit.active = {cornea_c, anterior_chamber_depth};
  const Vector2d sigma(fit.priors.sigma[cornea_c], chamber_sigma_mm);
  const Vector2d prior_mean(fit.priors.mean[cornea_c], fit.priors.mean[anterior_chamber_depth]);
  const Matrix2d prior = sigma.cwiseAbs2().cwiseInverse().asDiagonal();
  fit.covariance = (seen.information + prior).inverse();
  const Vector2d solution = fit.covariance * (seen.information * seen.mean + prior * prior_mean);
  fit.parameters[cornea_c] = solution[0];
  fit.parameters[anterior_chamber_depth] = solution[1];
  return fit;
}

/// Against the estimate of both eyes at once, with the correlated prior in one 4 x 4 matrix.
TEST(BothEyes, CouplingIsTheJointEstimate) {
  const Images right = images(42.1, 0.8, 3.3), left = images(43.4, 1.3, 3.5);
  EyeFit od = fit_of(right), os = fit_of(left);

  const double spread = od.priors.sigma[cornea_c];
  const double shared = spread * spread - std::pow(corneal_power_difference_D * per_dioptre, 2) / 2;
  Matrix4d prior = Matrix4d::Zero();
  prior.diagonal() << spread * spread, std::pow(chamber_sigma_mm, 2), spread * spread,
      std::pow(chamber_sigma_mm, 2);
  prior(0, 2) = prior(2, 0) = shared;
  prior(1, 3) = prior(3, 1) =
      chamber_sigma_mm * chamber_sigma_mm - std::pow(chamber_depth_difference_mm, 2) / 2;
  Matrix4d information = Matrix4d::Zero();
  information.topLeftCorner<2, 2>() = right.information;
  information.bottomRightCorner<2, 2>() = left.information;
  Vector4d seen, believed;
  seen << right.mean, left.mean;
  believed << od.priors.mean[cornea_c], od.priors.mean[anterior_chamber_depth], od.priors.mean[cornea_c],
      od.priors.mean[anterior_chamber_depth];
  const Matrix4d covariance = (information + prior.inverse()).inverse();
  const Vector4d expected = covariance * (information * seen + prior.inverse() * believed);

  ASSERT_TRUE(couple_eyes(od, os));
  EXPECT_NEAR(od.value(cornea_c), expected[0], 1e-9);
  EXPECT_NEAR(od.value(anterior_chamber_depth), expected[1], 1e-9);
  EXPECT_NEAR(os.value(cornea_c), expected[2], 1e-9);
  EXPECT_NEAR(os.value(anterior_chamber_depth), expected[3], 1e-9);
  EXPECT_NEAR((od.covariance - covariance.topLeftCorner<2, 2>()).norm(), 0, 1e-9);
  EXPECT_NEAR((os.covariance - covariance.bottomRightCorner<2, 2>()).norm(), 0, 1e-9);
}

/// Two eyes in one stack: corneas equally bright against the aqueous, images equally sharp. By hand: two
/// measurements of variance v whose difference has variance d^2 move towards each other by 2 v / (d^2 + 2 v)
/// of half their difference, and the variance of each becomes v (d^2 + v) / (d^2 + 2 v).
TEST(BothEyes, OneStackHasOneSharpnessAndOneBrightnessOfCorneas) {
  Stack stack;
  const auto eye = [&](double of_cornea, double sharpness) {
    EyeFit fit = fit_of(images(43, 0.8, 3.3));
    const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
    fit.stacks.push_back({&stack, 1, {x, y, x.cross(y)}, {}});
    const int at = fit.layout.stack(0) + log_sharpness;
    fit.active = {cornea_c, cornea, aqueous, at};
    fit.parameters[cornea] = of_cornea;
    fit.parameters[aqueous] = 0.2;
    fit.parameters[at] = sharpness;
    fit.covariance = Eigen::Vector4d(1e-6, 0.04 * 0.04, 1e-20, 0.03 * 0.03).asDiagonal();
    return fit;
  };
  EyeFit od = eye(0.40, 0.02), os = eye(0.36, 0.06);
  const int at = od.layout.stack(0) + log_sharpness;
  ASSERT_TRUE(couple_eyes(od, os));
  {
    const double v = 0.03 * 0.03, d2 = sharpness_difference * sharpness_difference;
    EXPECT_NEAR(od.value(at), 0.04 - 0.02 * d2 / (d2 + 2 * v), 1e-9);
    EXPECT_NEAR(os.covariance(3, 3), v * (d2 + v) / (d2 + 2 * v), 1e-9);
  }
  // The logarithm's variance is 0.01 in one eye and 0.0123 in the other: weighted by them.
  const double v1 = 0.01, v2 = std::pow(0.04 / 0.36, 2), d2 = std::pow(corneal_intensity_difference, 2);
  const double apart = std::log(0.36 / 0.40);
  EXPECT_NEAR(od.value(cornea), 0.40 + 0.40 * apart * v1 / (v1 + v2 + d2), 1e-6);
  EXPECT_NEAR(os.value(cornea), 0.36 - 0.36 * apart * v2 / (v1 + v2 + d2), 1e-6);
  EXPECT_NEAR(od.covariance(1, 1), 0.04 * 0.04 * (v2 + d2) / (v1 + v2 + d2), 1e-9);
}

/// What images do not see stays as wide in each eye as in a stranger's: two eyes of a person are no second
/// measurement of the population.
TEST(BothEyes, APriorIsNotCountedTwice) {
  const auto eye = [](double thickness_mm, double sigma_mm) {
    EyeFit fit = fit_of(images(43, 0.8, 3.3));
    fit.active = {cornea_c, cornea_thickness};
    fit.parameters[cornea_thickness] = thickness_mm;
    fit.covariance = Eigen::Vector2d(1e-6, sigma_mm * sigma_mm).asDiagonal();
    return fit;
  };
  const double sigma = fit_of(images(43, 0.8, 3.3)).priors.sigma[cornea_thickness];
  {
    EyeFit od = eye(0.55, sigma), os = eye(0.55, sigma);
    ASSERT_TRUE(couple_eyes(od, os));
    EXPECT_NEAR(std::sqrt(od.covariance(1, 1)), sigma, 1e-9);
    EXPECT_NEAR(od.value(cornea_thickness), 0.55, 1e-9);
  }
  // One eye is measured: the other is as thick but for the difference.
  EyeFit od = eye(0.60, 1e-5), os = eye(0.55, sigma);
  ASSERT_TRUE(couple_eyes(od, os));
  const double difference2 = std::pow(corneal_thickness_difference_mm, 2), sigma2 = sigma * sigma;
  const double covariance = sigma2 - difference2 / 2;
  EXPECT_NEAR(os.value(cornea_thickness), 0.55 + covariance / sigma2 * 0.05, 1e-5);
  EXPECT_NEAR(os.covariance(1, 1), sigma2 - covariance * covariance / sigma2, 1e-7);
}

/// Chambers a millimetre apart are a disease's, not a measurement's error.
TEST(BothEyes, UnlikeChambersAreLeftAlone) {
  EyeFit od = fit_of(images(43, 0.8, 2.6)), os = fit_of(images(43, 0.8, 3.6));
  const double before = od.value(anterior_chamber_depth);
  ASSERT_TRUE(couple_eyes(od, os));
  EXPECT_NEAR(od.value(anterior_chamber_depth), before, 0.01);
}

TEST(BothEyes, UnlikeCorneasAreLeftAlone) {
  EyeFit od = fit_of(images(43, 0.3, 3.3)), os = fit_of(images(52, 0.3, 3.3));
  const VectorXd before = od.parameters;
  EXPECT_FALSE(couple_eyes(od, os));
  EXPECT_EQ(od.parameters, before);
}

}  // namespace
}  // namespace emmetrope::segmentation
