#include "segmentation/fit/both_contrasts.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/patient_frame.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::vector<int> shape{cornea_c, anterior_chamber_depth, lens_thickness, axial_length, globe_x,
                             globe_y};

/// A positive definite matrix of this size, times `scale`.
MatrixXd random_information(Index size, std::mt19937& random, double scale) {
  std::normal_distribution<double> normal;
  const MatrixXd root = MatrixXd::NullaryExpr(size, size, [&] { return normal(random); });
  return scale * (root * root.transpose() + MatrixXd::Identity(size, size));
}

/// What the images of one contrast say of the shape and of the place of the apex, which is another in each.
struct Images {
  VectorXd mean;
  MatrixXd information;
};

EyeFit fit_of(const Images& images, const std::vector<int>& active, const VectorXd& prior_mean,
              const MatrixXd& prior_information, Weighting weighting) {
  const ParameterLayout layout;
  EyeFit fit{layout, weighting, {}, ForwardModel(layout, {}, Eigen::Vector3d::Zero())};
  fit.parameters = population_mean(layout);
  fit.priors = population_priors(layout, fit.parameters, weighting);
  fit.active = active;
  fit.covariance = (images.information + prior_information).inverse();
  const VectorXd solution =
      fit.covariance * (images.information * images.mean + prior_information * prior_mean);
  for (std::size_t i = 0; i < active.size(); ++i) fit.parameters[active[i]] = solution[static_cast<Index>(i)];
  return fit;
}

/// The population's prior of these parameters, of which the curvature's mean follows the length; none of the apex.
struct Prior {
  VectorXd mean;
  MatrixXd information;
};
Prior prior_of(const std::vector<int>& active) {
  const ParameterLayout layout;
  const Priors priors = population_priors(layout, population_mean(layout), Weighting::t2);
  const auto size = static_cast<Index>(active.size());
  MatrixXd whitening = MatrixXd::Zero(size, size);
  Prior prior{VectorXd(size), {}};
  for (Index i = 0; i < size; ++i) {
    const int parameter = active[static_cast<std::size_t>(i)];
    prior.mean[i] = priors.mean[parameter];
    if (parameter == apex_x) continue;
    whitening(i, i) = 1 / priors.sigma[parameter];
    if (parameter == cornea_c)
      for (Index j = 0; j < size; ++j)
        if (active[static_cast<std::size_t>(j)] == axial_length)
          whitening(i, j) = -priors.curvature_per_axial_length / priors.sigma[cornea_c];
  }
  prior.information = whitening.transpose() * whitening;
  return prior;
}

/// Against the estimate from all images at once, with both places of the apex; of fits that are not too far apart.
TEST(BothContrasts, JoiningIsTheJointEstimate) {
  std::mt19937 random(5);
  std::vector<int> of_a{apex_x}, of_b = shape;
  of_a.insert(of_a.end(), shape.begin(), shape.end());
  of_b.push_back(apex_x);  // the order is each fit's own
  const Prior prior_a = prior_of(of_a), prior_b = prior_of(of_b);
  const auto n = static_cast<Index>(shape.size());
  const Images a{prior_a.mean + 0.02 * VectorXd::Random(n + 1), random_information(n + 1, random, 30)},
      b{prior_b.mean + 0.02 * VectorXd::Random(n + 1), random_information(n + 1, random, 60)};
  EyeFit t2 = fit_of(a, of_a, prior_a.mean, prior_a.information, Weighting::t2),
         t1 = fit_of(b, of_b, prior_b.mean, prior_b.information, Weighting::t1);

  // Apex in a, shape, apex in b.
  MatrixXd information = MatrixXd::Zero(n + 2, n + 2);
  VectorXd information_mean = VectorXd::Zero(n + 2);
  information.topLeftCorner(n + 1, n + 1) += a.information + prior_a.information;
  information_mean.head(n + 1) += a.information * a.mean + prior_a.information * prior_a.mean;
  information.bottomRightCorner(n + 1, n + 1) += b.information;
  information_mean.tail(n + 1) += b.information * b.mean;
  const MatrixXd covariance = information.inverse();
  const VectorXd expected = covariance * information_mean;

  ASSERT_LT(agreement_of(t2, t1).birge_ratio, 1);
  join_contrasts(t2, t1, Joined::all);
  for (Index i = 0; i <= n; ++i) {
    EXPECT_NEAR(t2.value(of_a[static_cast<std::size_t>(i)]), expected[i], 1e-9);
    EXPECT_NEAR(t1.value(of_b[static_cast<std::size_t>(i)]), expected[i + 1], 1e-9);
  }
  EXPECT_TRUE(t2.covariance.isApprox(covariance.topLeftCorner(n + 1, n + 1), 1e-9));
  EXPECT_TRUE(t1.covariance.isApprox(covariance.bottomRightCorner(n + 1, n + 1), 1e-9));
}

EyeFit eye_of_length(double length_mm, double sigma_mm, Weighting weighting) {
  const Prior prior = prior_of({axial_length});
  Images images{VectorXd::Constant(1, length_mm), MatrixXd::Constant(1, 1, 1 / (sigma_mm * sigma_mm))};
  images.information -= prior.information;
  images.mean = ((images.information + prior.information) * images.mean - prior.information * prior.mean) /
                images.information(0, 0);
  return fit_of(images, {axial_length}, prior.mean, prior.information, weighting);
}

TEST(BothContrasts, AgreementIsInStandardDeviationsOfBoth) {
  const EyeFit t2 = eye_of_length(24, 0.3, Weighting::t2), t1 = eye_of_length(23, 0.4, Weighting::t1);
  const Agreement agreement = agreement_of(t2, t1);
  EXPECT_EQ(agreement.farthest, pole_depth) << "in neither anything else was free";
  EXPECT_NEAR(agreement.apart_mm, 1, 1e-9);
  EXPECT_NEAR(agreement.sigmas, 2, 1e-9);
  EXPECT_NEAR(agreement.weight_of_first, 0.64, 1e-9);
}

/// The scale factor of the Particle Data Group, here on what images say without a prior.
TEST(BothContrasts, WhatIsFartherApartThanItSaysIsKnownLess) {
  for (const auto& [apart_mm, scale] : {std::pair{0.4, 1.0}, {1.0, 2.0}, {1.4, 2.8}}) {
    EyeFit t2 = eye_of_length(24, 0.3, Weighting::t2), t1 = eye_of_length(24 - apart_mm, 0.4, Weighting::t1);
    for (EyeFit* fit : {&t2, &t1}) fit->priors.sigma[axial_length] = 1e4;
    join_contrasts(t2, t1, Joined::all);
    EXPECT_NEAR(t2.value(axial_length), 24 - 0.36 * apart_mm, 1e-6);
    EXPECT_NEAR(t2.sigma(axial_length), scale * 0.3 * 0.4 / 0.5, 1e-6) << apart_mm;
  }
}

/// Widened for what the model does not explain, a covariance may be the prior's, or more.
TEST(BothContrasts, AFitThatKnowsLessThanThePriorSaysNothing) {
  EyeFit a = eye_of_length(24, 0.3, Weighting::t2), b = eye_of_length(26, 0.4, Weighting::t1);
  b.covariance(0, 0) = 2 * std::pow(b.priors.sigma[axial_length], 2);
  join_contrasts(a, b, Joined::all);
  EXPECT_NEAR(a.value(axial_length), 24, 1e-9);
  EXPECT_NEAR(a.sigma(axial_length), 0.3, 1e-9);
}

TEST(BothContrasts, FitsThatContradictDoubtEachOther) {
  EyeFit t2 = eye_of_length(24, 0.3, Weighting::t2), t1 = eye_of_length(22, 0.4, Weighting::t1);
  doubt_each_other(t2, t1);
  EXPECT_NEAR(t2.value(axial_length), 24, 1e-9);
  EXPECT_NEAR(t1.value(axial_length), 22, 1e-9);
  // Four standard deviations apart: as much wider.
  EXPECT_NEAR(t2.sigma(axial_length), 4 * 0.3, 1e-9);
  EXPECT_NEAR(t1.sigma(axial_length), 4 * 0.4, 1e-9);
}

/// An error of both contrasts is in neither's difference from the other, and is no smaller in their mean: fits that have it
/// are joined as those without.
TEST(BothContrasts, WhatBothErrByAlikeIsNotAveraged) {
  std::mt19937 random(7);
  const Prior prior = prior_of(shape);
  const auto n = static_cast<Index>(shape.size());
  std::array<EyeFit, 2> without{
      fit_of({prior.mean + 0.05 * VectorXd::Random(n), random_information(n, random, 30)}, shape, prior.mean,
             prior.information, Weighting::t2),
      fit_of({prior.mean + 0.05 * VectorXd::Random(n), random_information(n, random, 60)}, shape, prior.mean,
             prior.information, Weighting::t1)};
  std::array<EyeFit, 2> with = without;
  const Index lens = std::find(shape.begin(), shape.end(), lens_thickness) - shape.begin();
  MatrixXd alike = MatrixXd::Zero(n, n);
  alike(lens, lens) = 0.03 * 0.03;
  for (EyeFit& fit : with) {
    fit.common_covariance = fit.shared_covariance = alike;
    fit.covariance += alike;
  }
  EXPECT_NEAR(agreement_of(with[0], with[1]).birge_ratio, agreement_of(without[0], without[1]).birge_ratio,
              1e-9);
  join_contrasts(without[0], without[1], Joined::all);
  join_contrasts(with[0], with[1], Joined::all);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR((with[i].parameters - without[i].parameters).norm(), 0, 1e-9);
    EXPECT_TRUE(with[i].covariance.isApprox(without[i].covariance + alike, 1e-9));
    EXPECT_EQ(with[i].common_covariance, alike) << "the fellow eye has it, too";
    EXPECT_EQ(with[i].shared_covariance.size(), 0);
  }
}

/// A free form is no biconic's.
TEST(BothContrasts, AnIrregularCorneaIsNotJoinedWithARegularOne) {
  EyeFit a = eye_of_length(24, 0.3, Weighting::t2), b = eye_of_length(24.2, 0.3, Weighting::t1);
  for (EyeFit* fit : {&a, &b}) {
    fit->active = {cornea_c, axial_length};
    fit->covariance = MatrixXd::Identity(2, 2) * 1e-4;
  }
  a.layout.irregular_cornea = true;
  const double curvature = a.value(cornea_c);
  b.parameters[cornea_c] += 0.01;
  join_contrasts(a, b, Joined::all);
  EXPECT_EQ(a.value(cornea_c), curvature);
  EXPECT_NEAR(a.value(axial_length), 24.1, 0.001);
}

TEST(BothContrasts, ACorneaThatIsNotKnownIsNotJoined) {
  EyeFit a = eye_of_length(24, 0.3, Weighting::t2), b = eye_of_length(24.2, 0.3, Weighting::t1);
  for (EyeFit* fit : {&a, &b}) {
    fit->active = {cornea_c, axial_length};
    fit->covariance = MatrixXd::Identity(2, 2) * 1e-4;
  }
  const double curvature = a.value(cornea_c);
  b.parameters[cornea_c] += 0.01;
  join_contrasts(a, b, Joined::behind_cornea);
  EXPECT_EQ(a.value(cornea_c), curvature);
}

/// The farthest of several that agree is no contradiction.
TEST(BothContrasts, BirgesRatioIsOfAllDistances) {
  EyeFit a = eye_of_length(24, 0.3, Weighting::t2), b = eye_of_length(24.9, 0.3, Weighting::t1);
  for (EyeFit* fit : {&a, &b}) {
    fit->active = {axial_length, lens_thickness};
    fit->covariance = MatrixXd::Identity(2, 2) * 0.09;
  }
  EXPECT_NEAR(agreement_of(a, b).sigmas, 0.9 / std::hypot(0.3, 0.3), 1e-9);
  EXPECT_NEAR(agreement_of(a, b).birge_ratio, 0.9 / std::hypot(0.3, 0.3) / std::sqrt(2.0), 1e-9);
}

/// An eye along voxels that lie turned by so much about its axis: its images tell every figure of its shape to so much, in
/// standard deviations of its prior, and have each so much off its mean.
EyeFit fit_along_voxels(double by_deg, double images_sigmas, double off_sigmas = 0) {
  ParameterLayout layout;
  layout.bumps = static_cast<int>(bump_directions().size());
  const Eigen::Matrix3d axes =
      Eigen::AngleAxisd(by_deg * degree, Eigen::Vector3d::UnitY()).toRotationMatrix();
  EyeFit fit{layout, Weighting::t2, {}, ForwardModel(layout, {}, Eigen::Vector3d::Zero()).along(axes)};
  fit.parameters = population_mean(layout);
  fit.priors = population_priors(layout, fit.parameters, Weighting::t2);
  for (int i = anterior_chamber_depth; i <= globe_z; ++i) fit.active.push_back(i);
  for (int i = 0; i < layout.bumps; ++i) fit.active.push_back(layout.displacement() + i);
  VectorXd variances(static_cast<Index>(fit.active.size()));
  for (Index i = 0; i < variances.size(); ++i) {
    const int parameter = fit.active[static_cast<std::size_t>(i)];
    variances[i] = std::pow(fit.priors.sigma[parameter], 2) / (1 + std::pow(images_sigmas, -2));
    fit.parameters[parameter] += off_sigmas * std::sin(1.7 * parameter) * fit.priors.sigma[parameter];
  }
  fit.covariance = variances.asDiagonal();
  return fit;
}

/// The same, told along the patient's axes.
EyeFit turned_fit(double by_deg, double images_sigmas) {
  return along_patient(fit_along_voxels(by_deg, images_sigmas));
}

/// What one contrast's images do not say, another's fit is not surer of: the prior of either is that of its own voxels' axes.
TEST(BothContrasts, AContrastThatSawNothingTellsNothing) {
  constexpr double nothing = 1e6;
  for (const auto& [first_deg, second_deg] :
       {std::pair{0.0, 5.0}, {0.0, 10.0}, {0.0, 30.0}, {10.0, 10.0}, {5.0, 0.0}}) {
    EyeFit first = turned_fit(first_deg, 0.5), second = turned_fit(second_deg, nothing);
    const EyeFit alone = first;
    join_contrasts(first, second, Joined::all);
    for (const int parameter : first.active)
      EXPECT_NEAR(first.sigma(parameter), alone.sigma(parameter), 1e-3 * alone.sigma(parameter))
          << parameter << " turned by " << first_deg << " and " << second_deg;
    EXPECT_LT((first.parameters - alone.parameters).norm(), 1e-3);
  }
}

/// Two contrasts along the same turned voxels: joined and turned is turned and joined, but for what a turn loses of patterns.
TEST(BothContrasts, AreAsSureTogetherHoweverTheVoxelsLie) {
  for (const double by_deg : {0.0, 2.0, 5.0}) {
    EyeFit first = turned_fit(by_deg, 0.5), second = turned_fit(by_deg, 0.5);
    join_contrasts(first, second, Joined::all);
    const EyeFit expected = turned_fit(by_deg, 0.5 / std::sqrt(2));
    for (const int parameter : {int(globe_x), int(globe_y), int(globe_z), int(axial_length)}) {
      const double ratio = first.sigma(parameter) / expected.sigma(parameter);
      EXPECT_GT(ratio, 0.99) << parameter << " turned by " << by_deg;
      EXPECT_LT(ratio, 1.05) << parameter << " turned by " << by_deg;
    }
  }
}

TEST(BothContrasts, ComeToTheSameEyeHoweverTheVoxelsLie) {
  for (const double by_deg : {5.0, 20.0}) {
    EyeFit along = fit_along_voxels(by_deg, 0.5, 0.2), along_too = fit_along_voxels(by_deg, 0.7, -0.3),
           first = along_patient(along), second = along_patient(along_too);
    join_contrasts(along, along_too, Joined::all);
    const EyeFit expected = along_patient(along);
    join_contrasts(first, second, Joined::all);
    for (const int parameter : first.active)
      EXPECT_NEAR(first.value(parameter), expected.value(parameter), 0.1 * expected.priors.sigma[parameter])
          << parameter << " turned by " << by_deg;
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
