#pragma once
#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

#include "segmentation/fit/forward_model.hpp"

namespace emmetrope::segmentation {

/// What is minimised: sum over samples of c^2 log(1 + r^2 / c^2), r = (value - E[magnitude]) / deviation,
/// plus the priors.
struct FitProblem {
  const ForwardModel* model = nullptr;
  std::vector<Sample> samples;
  Priors priors;
  /// Sclera meets cornea at the limbus: distance of the outer globe from four points of the anterior cornea
  /// there. It ties the front of the globe, where no voxel is used, to the rest. 0: not asked for.
  double limbus_sigma_mm = 0.6;
  double loss_scale = 3;  ///< c
  bool rician = false;    ///< compare with the mean magnitude instead of the signal
};

/// Half the summed squares at `parameters`, and for the Gauss-Newton step the normal equations over all
/// parameters.
struct NormalEquations {
  double cost = 0;
  Eigen::MatrixXd hessian;   ///< J'J, lower triangle filled
  Eigen::VectorXd gradient;  ///< J'r
};
NormalEquations evaluate(const FitProblem& problem, const Eigen::VectorXd& parameters, bool derivatives);

/// The samples' residuals as the loss counts them, whose squares sum to it, and their derivatives.
struct LinearRows {
  Eigen::SparseMatrix<double, Eigen::RowMajor> jacobian;  ///< sample by combination of parameters
  Eigen::VectorXd residual;
};

/// Which combinations of parameters move: parameters = start + basis z.
using Basis = Eigen::SparseMatrix<double>;
Basis select_parameters(int size, const std::vector<int>& active);

struct SolveResult {
  Eigen::VectorXd parameters;
  double cost = 0;
  int iterations = 0;
  bool converged = false;
};

/// When a solution is good enough.
struct SolveLimits {
  int iterations;
  double cost_tolerance = 3e-6;  ///< a step that gains a smaller share of the cost is the last
};

/// Levenberg-Marquardt by Ceres on the condensed problem: the voxels' rows are summed into normal equations
/// by blocks as they are made, and Ceres sees L' z (J'J = L L'), which has the same cost, gradient and Gauss-Newton
/// matrix.
SolveResult solve(const FitProblem& problem, const Eigen::VectorXd& start, const Basis& basis,
                  const SolveLimits& stop);

/// Covariance of the parameters that move, at a solution: inverse of J'J with the priors, by
/// ceres::Covariance, which checks the rank. In the order of the basis' columns.
/// \throw Error (no_result) when J'J is rank deficient
Eigen::MatrixXd covariance(const FitProblem& problem, const Eigen::VectorXd& parameters, const Basis& basis);

/// \param basis  a selection of parameters
LinearRows linearise(const FitProblem& problem, const Eigen::VectorXd& parameters, const Basis& basis);

/// Standardised residual of one sample, without the loss.
double residual(const FitProblem& problem, const ForwardModel::AtParameters& at, const Sample& sample);

}  // namespace emmetrope::segmentation
