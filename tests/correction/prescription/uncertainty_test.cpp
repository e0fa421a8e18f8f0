#include "correction/prescription/uncertainty.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "correction/prescription/prescription.hpp"
#include "meshing/optics.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "tests/support/measured_optics.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope::correction {
namespace {

PowerVector paraxial(const EyeModel& eye) { return paraxial_refraction(eye, 589.3); }

TEST(Uncertainty, SensitivitiesAreThoseOfTheLiterature) {
  const UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const auto dM = [&](const char* parameter) { return s(0, eye.known.index_of(parameter)); };
  // Gullstrand's eye: axial length -2.56 D/mm, chamber +1.18, lens radii +0.37 and +0.73 D/mm. Its lens radii
  // act on the cortex' step of index, 0.050, this lens's on 0.0894.
  constexpr double step = 0.0894 / 0.050;
  EXPECT_NEAR(dM("axial_length_mm"), -2.56, 0.3);
  EXPECT_NEAR(dM("anterior_chamber_depth_mm"), 1.18, 0.4);
  EXPECT_NEAR(dM("lens_anterior_radius_mm"), 0.37 * step, 0.1);
  EXPECT_NEAR(dM("lens_posterior_radius_mm"), 0.73 * step, 0.2);
  EXPECT_NEAR(dM("lens_index"), -155, 20);
  // 376 D per unit of curvature in front, 40 / 0.83 less behind: about -330, at the cornea itself.
  EXPECT_NEAR(dM("cornea_c_per_mm"), -376 + 40 / 0.83, 15);
  EXPECT_NEAR(s(1, eye.known.index_of("cornea_j0_per_mm")), -376 + 40 / 0.83, 15);
  EXPECT_NEAR(s(2, eye.known.index_of("cornea_j45_per_mm")), -376 + 40 / 0.83, 15);
  EXPECT_NEAR(s(1, eye.known.index_of("cornea_j45_per_mm")), 0, 2);
  EXPECT_NEAR(dM("cornea_q"), 0, 1e-6);
}

TEST(Uncertainty, BudgetAddsUpToTheTotal) {
  const UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const auto budget = uncertainty_budget(eye, s);
  double sum = 0;
  for (std::size_t i = 0; i + 1 < budget.size(); ++i) sum += budget[i].M_D * std::abs(budget[i].M_D);
  EXPECT_EQ(budget.back().source, "total");
  EXPECT_NEAR(sum, budget.back().M_D * budget.back().M_D, 1e-9);
  EXPECT_NEAR(budget[6].M_D, 155 * 0.005, 0.1);  // the lens index
  // Chamber and lens alone are correlated.
  const Eigen::Index chamber = eye.known.index_of("anterior_chamber_depth_mm"),
                     lens = eye.known.index_of("lens_thickness_mm");
  EXPECT_NEAR(budget[7].M_D * std::abs(budget[7].M_D),
              2 * s(0, chamber) * s(0, lens) * eye.known.eye().covariance(chamber, lens), 1e-9);
}

/// One that no group names, or two, would pass for correlations. Those of an irregular cornea are all that there are.
TEST(Uncertainty, EachParameterIsInOneLineOfTheBudget) {
  ParametricEye fitted = random_eye(5);
  fitted.cornea_zernike_um.front() = 1;
  UncertainOptics optics =
      uncertain_optics_from_json(meshing::optics_json(fitted_eye(fitted), {}), ".", 0.005);
  ParametricEye apart = optics.known.eye();
  apart.covariance.setIdentity();
  optics.known = UncertainEye(apart);
  for (Eigen::Index i = 0; i < apart.covariance.rows(); ++i) {
    Eigen::MatrixXd alone = Eigen::MatrixXd::Zero(3, apart.covariance.cols());
    alone(0, i) = 1;
    const auto budget = uncertainty_budget(optics, alone);
    const auto of_it =
        std::count_if(budget.begin(), budget.end() - 2, [](const BudgetLine& line) { return line.M_D > 0; });
    EXPECT_EQ(of_it, 1) << apart.parameter_names[static_cast<std::size_t>(i)];
  }
}

TEST(Uncertainty, LinearAgreesWithMonteCarlo) {
  // What prescriptions carry is the derivative of the least-squares fit of ray slopes.
  const UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const RefractionOf refraction = [](const EyeModel& one) { return refraction_by_spot(one, {}); };
  const Eigen::MatrixXd s = refraction_sensitivity(eye, refraction);
  const Eigen::Matrix3d linear = s * eye.known.eye().covariance * s.transpose();
  const Eigen::MatrixXd root = eye.known.eye().covariance.llt().matrixL();
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  constexpr int draws = 1500;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (int i = 0; i < draws; ++i) {
    Eigen::VectorXd unit(eye.known.parameters().mean.size());
    for (double& u : unit) u = normal(random);
    const PowerVector p = refraction(eye_at(eye, eye.known.parameters().mean + root * unit));
    const Eigen::Vector3d v(p.M_D, p.J0_D, p.J45_D);
    sum += v;
    squares += v * v.transpose();
  }
  const Eigen::Vector3d mean = sum / draws;
  const Eigen::Matrix3d sampled = squares / draws - mean * mean.transpose();
  // A standard deviation from 1500 draws is good to 1.8 %; three of those, and 2 % of curvature.
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::sqrt(sampled(i, i)) / std::sqrt(linear(i, i)), 1, 0.075) << i;
}

TEST(Uncertainty, MeasurementsBuyWhatTheyMust) {
  const UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const auto sigma_M = [&](const Eigen::MatrixXd& covariance) {
    return std::sqrt((s * covariance * s.transpose())(0, 0));
  };
  // A known refraction leaves less than its own error, a perfect axial length takes its share out of the
  // budget.
  EXPECT_LT(sigma_M(covariance_after(eye.known.eye().covariance, known_refraction(s, 0.25))), 0.25);
  const double before = sigma_M(eye.known.eye().covariance);
  const double axial = std::abs(s(0, eye.known.index_of("axial_length_mm"))) * 0.03;
  EXPECT_NEAR(sigma_M(covariance_after(eye.known.eye().covariance, optical_axial_length(eye, 1e-6))),
              std::sqrt(before * before - axial * axial), 1e-6);
  EXPECT_LT(sigma_M(covariance_after(eye.known.eye().covariance, keratometry(eye, 0.25))), before);
}

TEST(Uncertainty, KeratometryIsTheDerivativeOfItsDefinition) {
  const UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const PlannedObservation k = keratometry(eye, 0.25);
  const auto power = [](double c, double q) { return 337.5 / std::sqrt(1 / (c * c) - q * 1.5 * 1.5); };
  const double c = 1 / 7.8, q = -0.2, h = 1e-6;
  // Across the uncertainty of a toric cornea, not at a point of a round one.
  EXPECT_NEAR(k.sensitivity(0, eye.known.index_of("cornea_c_per_mm")),
              (power(c + h, q) - power(c - h, q)) / (2 * h), 2);
  EXPECT_NEAR(k.sensitivity(0, eye.known.index_of("cornea_q")), (power(c, q + h) - power(c, q - h)) / (2 * h),
              0.01);
  EXPECT_NEAR(k.noise_covariance(0, 0), 0.25 * 0.25 / 2, 1e-12);
}

TEST(Uncertainty, AReadingBecomesTheEyes) {
  UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const double promised = covariance_after(eye.known.eye().covariance, keratometry(eye, 0.02))(0, 0);
  InstrumentFlags flags;
  flags.keratometry = {"od:41.4@112/45.1@22+-0.02"};
  flags.axial_length = {"od:24.05+-0.005"};
  const auto warnings = learn(eye, read_instruments(parse_instruments(flags, 0).at(Laterality::od)));
  EXPECT_TRUE(warnings.empty()) << warnings.front();
  EXPECT_NEAR(eye.known.eye().covariance(0, 0), promised, 0.02 * promised);
  // The axial radius 1.5 mm off the apex in both meridians of the eye as it now is, by the surface itself.
  const ShapePtr cornea = eye.model.surface("cornea_anterior").shape;
  const auto power_D = [&](double axis_deg) {
    const double a = axis_deg * 3.14159265358979 / 180;
    const Eigen::Vector3d n = *cornea->normal(1.5 * std::cos(a), 1.5 * std::sin(a));
    return 337.5 * std::hypot(n.x(), n.y()) / 1.5;
  };
  EXPECT_NEAR(power_D(112), 41.4, 0.05);
  EXPECT_NEAR(power_D(22), 45.1, 0.05);
  EXPECT_NEAR(eye.model.axial_length_mm(), 24.05, 0.005);
  EXPECT_EQ(eye.known.origin_of(Eigen::RowVectorXd::Unit(s.cols(), 0)).source, "keratometry");
  EXPECT_EQ(eye.known.origin_of(Eigen::RowVectorXd::Unit(s.cols(), 10)).source, "biometry");
  EXPECT_EQ(eye.known.origin_of(s.row(1)).source, "keratometry");
}

TEST(Uncertainty, AnUnlikelyReadingIsWarnedOfAndAnImpossibleOneRefused) {
  const auto warnings = [](const char* axial_length) {
    UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
    InstrumentFlags flags;
    flags.axial_length = {axial_length};
    return learn(eye, read_instruments(parse_instruments(flags, 0).at(Laterality::od))).size();
  };
  // 24.00 +- 0.03 mm by the images.
  EXPECT_EQ(warnings("od:24.1+-0.05"), 0U);
  EXPECT_EQ(warnings("od:24.23+-0.05"), 1U);
  EXPECT_THROW(warnings("od:24.6+-0.05"), Error);
}

TEST(Uncertainty, AKnownRefractionIsLearnt) {
  UncertainOptics eye = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const auto refraction = [&](const Eigen::VectorXd& values) -> Eigen::VectorXd {
    const PowerVector p = paraxial(eye_at(eye, values));
    return Eigen::Vector3d(p.M_D, p.J0_D, p.J45_D);
  };
  const Eigen::Vector3d wanted = refraction(eye.known.parameters().mean) + Eigen::Vector3d(1.5, 0.3, -0.2);
  const double index = eye.known.parameters().mean[eye.known.index_of("lens_index")];
  learn(eye, "refraction", refraction, wanted, 1e-6 * Eigen::Matrix3d::Identity());
  EXPECT_LT((refraction(eye.known.parameters().mean) - wanted).norm(), 0.005);
  EXPECT_LT(eye.known.parameters().mean[eye.known.index_of("lens_index")], index - 0.001);
}

TEST(Uncertainty, IntervalsInEveryNotation) {
  const Eigen::Matrix3d covariance = Eigen::Vector3d(0.25, 0.01, 0.01).asDiagonal();
  const std::array<Origin, 3> sources{"mri", "mri", "mri"};
  const auto at = refraction_intervals({-3, 0.5, 0}, covariance, sources);
  EXPECT_NEAR(at.M_D.ci95[0], -3 - 1.96 * 0.5, 1e-3);
  EXPECT_NEAR(at.J0_D.sigma(), 0.1, 1e-9);
  EXPECT_EQ(at.axis_deg.source, "mri");
  EXPECT_NEAR(at.axis_deg.sigma(), 5.73, 0.01);  // sigma_J45 / J / 2
  EXPECT_NEAR(at.cylinder_D.sigma(), 0.2, 1e-9);
  EXPECT_NEAR(at.sphere_D.sigma(), std::sqrt(0.26), 1e-9);
}

TEST(Uncertainty, WhatAGivenRefractionNarrowedIsOfBoth) {
  EXPECT_EQ(with_refraction("mri", 0.048, 0.028).source, "mri+refraction");
  EXPECT_EQ(with_refraction("mri", 0.048, 0.046).source, "mri");
  EXPECT_EQ(with_refraction("refraction", 1.3, 0.06).source, "refraction");
}

TEST(Uncertainty, AnAstigmatismThatMayBeNoneHasAnyAxis) {
  const Eigen::Matrix3d covariance = Eigen::Vector3d(0.25, 0.01, 0.01).asDiagonal();
  const std::array<Origin, 3> sources{"mri", "mri", "mri"};
  const auto drowned = refraction_intervals({-3, 0.12, 0.12}, covariance, sources);
  EXPECT_EQ(drowned.cylinder_D.ci95[1], 0);
  EXPECT_NEAR(drowned.axis_deg.ci95[1] - drowned.axis_deg.ci95[0], 180, 1e-9);
  const auto none = refraction_intervals({-3, 0, 0}, covariance, sources);
  EXPECT_EQ(none.cylinder_D.value, 0);
  EXPECT_NEAR(none.axis_deg.ci95[1] - none.axis_deg.ci95[0], 180, 1e-9);
}

// Linear propagation against draws, for an oblique and correlated case.
TEST(Uncertainty, IntervalsAreThoseOfDraws) {
  const PowerVector mean{-2, 0.6, -0.5};
  Eigen::Matrix3d root;
  root << 0.4, 0, 0, 0.05, 0.08, 0, -0.03, 0.02, 0.1;
  const auto at = refraction_intervals(mean, root * root.transpose(), {"mri", "mri", "mri"});
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  constexpr int draws = 20000;
  int sphere = 0, cylinder = 0, axis = 0;
  for (int i = 0; i < draws; ++i) {
    const double a = normal(random), b = normal(random), c = normal(random);
    const Eigen::Vector3d drawn =
        Eigen::Vector3d(mean.M_D, mean.J0_D, mean.J45_D) + root * Eigen::Vector3d(a, b, c);
    const SpheroCylinder notation = to_sphero_cylinder({drawn[0], drawn[1], drawn[2]});
    const auto holds = [](const Measured& m, double value) {
      return m.ci95[0] <= value && value <= m.ci95[1];
    };
    sphere += holds(at.sphere_D, notation.sphere_D);
    cylinder += holds(at.cylinder_D, notation.cylinder_D);
    axis +=
        holds(at.axis_deg, at.axis_deg.value + std::remainder(notation.axis_deg - at.axis_deg.value, 180));
  }
  for (const int held : {sphere, cylinder, axis}) EXPECT_NEAR(held / double{draws}, 0.95, 0.01);
}

TEST(Uncertainty, SurpriseIsThatOfANormalNumber) {
  // Three numbers known to 1 and measured to 0: what chi2 tables have for three degrees of freedom.
  const auto innovation = [](const Eigen::VectorXd& off) {
    const Eigen::Index n = off.size();
    NormalDistribution numbers{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Identity(n, n)};
    return condition(
        numbers, [](const Eigen::VectorXd& x) { return x; }, off, 1e-12 * Eigen::MatrixXd::Identity(n, n));
  };
  EXPECT_NEAR(innovation(Eigen::VectorXd::Constant(1, -3.3)), 3.3, 1e-6);
  EXPECT_NEAR(innovation(Eigen::Vector3d(0, std::sqrt(7.815), 0)), 1.960, 1e-3);    // p = 0.05
  EXPECT_NEAR(innovation(Eigen::Vector3d(0, 0, std::sqrt(16.266))), 3.2905, 1e-3);  // p = 0.001
  EXPECT_NEAR(innovation(Eigen::Vector2d(std::sqrt(13.816), 0)), 3.2905, 1e-3);
  EXPECT_GT(innovation(Eigen::Vector3d(0, 60, 0)), 30);
}

}  // namespace
}  // namespace emmetrope::correction
