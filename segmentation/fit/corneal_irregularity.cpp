#include "segmentation/fit/corneal_irregularity.hpp"

#include <Eigen/Cholesky>

namespace emmetrope::segmentation {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd with_free_form(const VectorXd& parameters, const ParameterLayout& irregular) {
  VectorXd extended = population_mean(irregular);
  extended.head(parameters.size()) = parameters;
  return extended;
}

bool CornealIrregularity::found() const { return chi2 > chi2_limit; }

CornealIrregularity corneal_irregularity(const FitProblem& problem, const VectorXd& parameters,
                                         const std::vector<int>& active) {
  const ForwardModel model = problem.model->with_irregular_cornea();
  const ParameterLayout& layout = model.layout();
  FitProblem irregular = problem;
  irregular.model = &model;
  // No prior of the terms: the images alone are asked. All else keeps the regular cornea's.
  irregular.priors.mean = with_free_form(problem.priors.mean, layout);
  irregular.priors.sigma = VectorXd::Constant(layout.size(), 1e6);
  irregular.priors.sigma.head(problem.priors.sigma.size()) = problem.priors.sigma;
  const NormalEquations equations = evaluate(irregular, with_free_form(parameters, layout), true);

  std::vector<int> terms;
  for (int i = 0; i < CornealIrregularity::tested_terms; ++i) terms.push_back(layout.corneal_form() + i);
  const MatrixXd hessian = equations.hessian.selfadjointView<Eigen::Lower>();
  const MatrixXd across = hessian(active, terms);
  const MatrixXd regression = MatrixXd(hessian(active, active)).llt().solve(across);
  const MatrixXd information = MatrixXd(hessian(terms, terms)) - across.transpose() * regression;
  // What is left of the gradient by the other parameters is taken for their next step.
  const VectorXd score =
      VectorXd(equations.gradient(terms)) - regression.transpose() * VectorXd(equations.gradient(active));
  return {score.dot(information.ldlt().solve(score))};
}

}  // namespace emmetrope::segmentation
