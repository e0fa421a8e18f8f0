#include "segmentation/fit/corneal_form_prior.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <array>
#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/parametric/corneal_form.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "segmentation/fit/least_squares.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Terms of the form's orders in a bump of 75 um, by least squares over points spread over the zone.
class Bumps {
 public:
  Bumps() : x_(count), y_(count), terms_(count, zernike_count(corneal_form_order)) {
    for (int i = 0; i < count; ++i) {
      const double rho = std::sqrt((i + 0.5) / count), angle = pi * (3 - std::sqrt(5.0)) * i;
      x_[i] = rho * std::cos(angle);
      y_[i] = rho * std::sin(angle);
      terms_.row(i) = zernike_values(corneal_form_order, x_[i], y_[i]);
    }
    solver_.compute(terms_);
  }
  VectorXd terms_um(double x_mm, double y_mm, double width_mm) const {
    const auto r2 = (corneal_form_radius_mm * x_.array() - x_mm).square() +
                    (corneal_form_radius_mm * y_.array() - y_mm).square();
    const VectorXd depth_um = 75 * (-r2 / (2 * width_mm * width_mm)).exp();
    return solver_.solve(depth_um).tail(corneal_form_terms);
  }

 private:
  static constexpr int count = 8000;
  VectorXd x_, y_;
  MatrixXd terms_;
  Eigen::HouseholderQR<MatrixXd> solver_;
};

/// The mean of the products over bumps in every direction, and the terms' own spread.
TEST(CornealFormPrior, IsThatOfBumps) {
  const Bumps bumps;
  MatrixXd expected = MatrixXd::Zero(corneal_form_terms, corneal_form_terms);
  constexpr int directions = 16;  // products of terms up to the seventh order turn 14 times
  for (const double width_mm : {1.1, 1.3, 1.5, 1.7, 1.9, 2.1})
    for (const double distance_mm : {0.1, 0.4, 0.8, 1.2, 1.6, 2.0})
      for (int k = 0; k < directions; ++k) {
        const double angle = 2 * pi * k / directions;
        const VectorXd terms =
            bumps.terms_um(distance_mm * std::cos(angle), distance_mm * std::sin(angle), width_mm);
        expected += terms * terms.transpose() / (36 * directions);
      }
  for (int i = 0; i < corneal_form_terms; ++i)
    expected(i, i) += std::pow(std::array{3.0, 2.0, 1.0, 0.5, 0.25}[zernike_index(6 + i).n - 3], 2);
  const MatrixXd covariance = corneal_form_covariance_um2();
  EXPECT_LT((covariance - expected).cwiseAbs().maxCoeff(), 0.01 * expected.maxCoeff());
  EXPECT_EQ(Eigen::LLT<MatrixXd>(covariance).info(), Eigen::Success);
}

/// What the cone of a typical keratoconus has is likely; a cone whose finer terms, which make its tip, have
/// the wrong sign is not.
TEST(CornealFormPrior, KnowsThatTermsOfABumpGoTogether) {
  const MatrixXd information = corneal_form_covariance_um2().inverse();
  const VectorXd cone = Bumps().terms_um(0.5, -1, 1.6);
  VectorXd no_cone = cone;
  for (int i = 0; i < corneal_form_terms; ++i)
    if (zernike_index(corneal_form_first + i).n >= 5) no_cone[i] = -cone[i];
  EXPECT_LT(cone.dot(information * cone), 5);
  EXPECT_GT(no_cone.dot(information * no_cone), 20);
}

/// Without a voxel the normal equations are the prior's: its covariance, its mean, and a cost of half of
/// Mahalanobis' distance.
TEST(CornealFormPrior, EntersTheFit) {
  ParameterLayout layout;
  layout.irregular_cornea = true;
  using Eigen::Vector3d;
  const ForwardModel model(layout,
                           {{Vector3d::UnitX(), -Vector3d::UnitZ(), Vector3d::UnitY(), 1.6, 1.6, 1, 2, 0.03}},
                           Vector3d::Zero());
  FitProblem problem;
  problem.model = &model;
  problem.limbus_sigma_mm = 0;
  VectorXd start = population_mean({});
  start[vitreous] = 1;
  problem.priors = irregular_cornea_priors(population_priors({}, start, Weighting::t2), layout);
  VectorXd parameters = problem.priors.mean;
  const VectorXd form = VectorXd::LinSpaced(corneal_form_terms, -2, 3);
  parameters.segment(layout.corneal_form(), corneal_form_terms) += form;
  const NormalEquations equations = evaluate(problem, parameters, true);
  const MatrixXd information = corneal_form_covariance_um2().inverse();
  const int first = layout.corneal_form();
  EXPECT_NEAR(equations.cost, form.dot(information * form) / 2, 1e-9 * equations.cost);
  EXPECT_LT((equations.gradient.segment(first, corneal_form_terms) - information * form).norm(), 1e-9);
  const MatrixXd hessian = equations.hessian.selfadjointView<Eigen::Lower>();
  EXPECT_LT((hessian.block(first, first, corneal_form_terms, corneal_form_terms) - information).norm(),
            1e-9 * information.norm());
}

}  // namespace
}  // namespace emmetrope::segmentation
