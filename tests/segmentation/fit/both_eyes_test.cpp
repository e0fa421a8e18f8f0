#include "segmentation/fit/both_eyes.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <tuple>

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
  EyeFit fit{layout, Weighting::t2, {}, ForwardModel(layout, {}, Eigen::Vector3d::Zero())};
  fit.parameters = mean;
  fit.priors = population_priors(layout, mean, Weighting::t2);
  fit.converged = true;
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

TEST(BothEyes, ThatLearnOfUnlikeImagesShareNoKnownErrorWithOthers) {
  EyeFit od = fit_of(images(42.1, 0.8, 3.3)), os = fit_of(images(43.4, 1.3, 3.5));
  od.shared_covariance = 0.75 * od.covariance;
  ASSERT_TRUE(couple_eyes(od, os));
  EXPECT_EQ(od.shared_covariance.size(), 0);
}

/// What both eyes' images err by alike is in neither's difference from the other: eyes that have it move as those without.
TEST(BothEyes, WhatBothEyesImagesShareTellsNothingOfTheOther) {
  EyeFit od = fit_of(images(42.1, 0.8, 3.3)), os = fit_of(images(43.4, 1.3, 3.5));
  EyeFit od_with = od, os_with = os;
  const Eigen::MatrixXd shared = 0.5 * od.covariance;
  for (EyeFit* eye : {&od_with, &os_with}) {
    eye->shared_covariance = shared;
    eye->covariance += shared;
  }
  ASSERT_TRUE(couple_eyes(od, os));
  ASSERT_TRUE(couple_eyes(od_with, os_with));
  EXPECT_NEAR((od_with.parameters - od.parameters).norm(), 0, 1e-12);
  EXPECT_NEAR((os_with.parameters - os.parameters).norm(), 0, 1e-12);
  EXPECT_NEAR((od_with.covariance - od.covariance - shared).norm(), 0, 1e-12);
  EXPECT_EQ(os_with.shared_covariance, shared);
}

/// One eye in T1 and its fellow in T2, or both in both: their lenses' nuclei are alike all the same.
TEST(BothEyes, WhatImagesOfAnyContrastShareTellsNothingOfTheOther) {
  EyeFit od = fit_of(images(42.1, 0.8, 3.3)), os = fit_of(images(43.4, 1.3, 3.5));
  EyeFit od_with = od, os_with = os;
  const Eigen::MatrixXd common = 0.5 * od.covariance;
  for (EyeFit* eye : {&od_with, &os_with}) {
    eye->common_covariance = common;
    eye->covariance += common;
  }
  ASSERT_TRUE(couple_eyes(od, os));
  ASSERT_TRUE(couple_eyes(od_with, os_with));
  EXPECT_NEAR((od_with.parameters - od.parameters).norm(), 0, 1e-12);
  EXPECT_NEAR((os_with.covariance - os.covariance - common).norm(), 0, 1e-12);
}

/// Lengths of both eyes at once, with the correlated prior in one 2 x 2 matrix.
TEST(BothEyes, LengthsOfOnePersonAreTheJointEstimate) {
  for (const auto& [parameter, difference_mm, sigma_mm] :
       {std::tuple{axial_length, axial_length_difference_mm, 0.12},
        {lens_thickness, lens_thickness_difference_mm, 0.08},
        {cornea_thickness, corneal_thickness_difference_mm, 0.03},
        {lid_thickness, lid_thickness_difference_mm, 0.15}}) {
    EyeFit od = fit_of(images(43, 0.8, 3.3)), os = od;
    const double spread = od.priors.sigma[parameter], mean = od.priors.mean[parameter];
    const std::array<double, 2> length{mean - 0.4 * difference_mm, mean + 0.9 * difference_mm},
        sigma{sigma_mm, 1.4 * sigma_mm};
    Matrix2d prior;
    const double shared = spread * spread - difference_mm * difference_mm / 2;
    prior << spread * spread, shared, shared, spread * spread;
    Matrix2d information = prior.inverse();
    Vector2d weighed = information * Vector2d(mean, mean);
    for (const int e : {0, 1}) {
      EyeFit& eye = e == 0 ? od : os;
      eye.active = {cornea_c, parameter};
      eye.parameters[parameter] = length[e];
      eye.covariance = Vector2d(1e-6, sigma[e] * sigma[e]).asDiagonal();
      // What the images alone say: the fit less the prior of a stranger.
      const double of_images = std::pow(sigma[e], -2) - std::pow(spread, -2);
      information(e, e) += of_images;
      weighed[e] += std::pow(sigma[e], -2) * length[e] - std::pow(spread, -2) * mean;
    }
    const Matrix2d covariance = information.inverse();
    const Vector2d expected = covariance * weighed;
    ASSERT_TRUE(couple_eyes(od, os));
    EXPECT_NEAR(od.value(parameter), expected[0], 1e-9) << parameter;
    EXPECT_NEAR(os.value(parameter), expected[1], 1e-9) << parameter;
    EXPECT_NEAR(od.covariance(1, 1), covariance(0, 0), 1e-9) << parameter;
    EXPECT_NEAR(os.covariance(1, 1), covariance(1, 1), 1e-9) << parameter;
  }
}

/// Two eyes in one stack: tissues equally bright against the aqueous, images equally sharp, fat equally
/// displaced. By hand: two measurements of variances v and w whose difference has variance d^2 move towards
/// each other by v / (d^2 + v + w) and w / (d^2 + v + w) of it, and v becomes v (d^2 + w) / (d^2 + v + w).
TEST(BothEyes, OneStackHasOneSharpnessOneChemicalShiftAndOneBrightnessOfTissues) {
  struct Seen {
    int parameter;
    double right, left, sigma, difference;
    bool is_brightness;
  };
  const ParameterLayout layout;
  const std::array<Seen, 7> table{
      {{cornea, 0.40, 0.36, 0.04, tissue_intensity_difference, true},
       {wall, 0.35, 0.38, 0.03, tissue_intensity_difference, true},
       {lid, 0.50, 0.58, 0.05, lid_intensity_difference, true},
       {layout.stack(0) + log_sharpness, 0.02, 0.06, 0.03, sharpness_difference, false},
       {layout.stack(0) + log_sharpness_ratio, 0.02, 0.05, 0.03, sharpness_difference, false},
       {layout.stack(0) + k_space_filter, 0.3, 0.33, 0.04, sharpness_difference, false},
       {layout.stack(0) + fat_shift_first, 0.10, 0.05, 0.06, fat_shift_difference_mm, false}}};
  Stack stack;
  const auto eye = [&](double Seen::*value) {
    EyeFit fit = fit_of(images(43, 0.8, 3.3));
    const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
    fit.stacks.push_back({&stack, 1, {x, y, x.cross(y)}, {}});
    fit.active = {cornea_c, aqueous};
    fit.parameters[aqueous] = 0.2;
    std::vector<double> variance{1e-6, 1e-20};
    for (const Seen& seen : table) {
      fit.active.push_back(seen.parameter);
      fit.parameters[seen.parameter] = seen.*value;
      variance.push_back(seen.sigma * seen.sigma);
    }
    fit.covariance =
        Eigen::Map<VectorXd>(variance.data(), static_cast<Eigen::Index>(variance.size())).asDiagonal();
    return fit;
  };
  EyeFit od = eye(&Seen::right), os = eye(&Seen::left);
  ASSERT_TRUE(couple_eyes(od, os));
  for (std::size_t i = 0; i < table.size(); ++i) {
    const Seen& seen = table[i];
    // Of the logarithm where it is a brightness.
    const double per_right = seen.is_brightness ? 1 / seen.right : 1,
                 per_left = seen.is_brightness ? 1 / seen.left : 1;
    const double apart = seen.is_brightness ? std::log(seen.left / seen.right) : seen.left - seen.right;
    const double v = std::pow(seen.sigma * per_right, 2), w = std::pow(seen.sigma * per_left, 2),
                 all = v + w + std::pow(seen.difference, 2);
    EXPECT_NEAR(od.value(seen.parameter), seen.right + apart * v / all / per_right, 1e-6) << i;
    EXPECT_NEAR(os.value(seen.parameter), seen.left - apart * w / all / per_left, 1e-6) << i;
    const auto at = static_cast<Eigen::Index>(i + 2);
    EXPECT_NEAR(od.covariance(at, at), seen.sigma * seen.sigma * (all - v) / all, 1e-9) << i;
  }
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
