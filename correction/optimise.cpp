#include "correction/optimise.hpp"

#include <ceres/first_order_function.h>
#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <fmt/core.h>

#include <cmath>

#include "pipeline/base/error.hpp"

namespace emmetrope::correction {
namespace {

/// (S_start / S)^2 with its gradient.
class InverseSquare : public ceres::FirstOrderFunction {
 public:
  InverseSquare(const SharpnessFunction& sharpness, const Bounds& bounds, double scale)
      : sharpness_(sharpness), bounds_(bounds), scale_(scale) {}

  bool Evaluate(const double* parameters, double* cost, double* gradient) const override {
    const Eigen::Map<const Eigen::VectorXd> lens(parameters, NumParameters());
    if (!bounds_.contain(lens)) return false;  // the line search takes a shorter step
    const SharpnessValue value = sharpness_(lens);
    if (!(value.value > 0) || !value.gradient.allFinite()) return false;
    *cost = scale_ * scale_ / (value.value * value.value);
    if (gradient)
      Eigen::Map<Eigen::VectorXd>(gradient, NumParameters()) = -2 * *cost / value.value * value.gradient;
    return true;
  }
  int NumParameters() const override { return static_cast<int>(bounds_.lower.size()); }

 private:
  const SharpnessFunction& sharpness_;
  const Bounds& bounds_;
  double scale_;
};

}  // namespace

Optimum climb(const SharpnessFunction& sharpness, const Eigen::VectorXd& start, const Bounds& bounds,
              const OptimiserSettings& settings) {
  if (!bounds.contain(start))
    throw Error(ExitStatus::fault, "a start of the lens search is outside its bounds");
  Optimum optimum;
  optimum.lens = start;

  // Evaluations are costly and Ceres asks again for points it has seen.
  Eigen::VectorXd cached_lens;
  SharpnessValue cached;
  int evaluations = 0;
  const SharpnessFunction remembering = [&](const Eigen::VectorXd& lens) {
    if (cached_lens.size() == 0 || cached_lens != lens) {
      cached = sharpness(lens);
      cached_lens = lens;
      ++evaluations;
    }
    return cached;
  };
  ceres::GradientProblemSolver::Options options;
  options.line_search_direction_type = ceres::BFGS;
  options.line_search_type = ceres::WOLFE;
  options.max_num_iterations = settings.max_iterations;
  options.gradient_tolerance = 2 * settings.gradient_tolerance_per_D;
  options.function_tolerance = settings.function_tolerance;
  options.parameter_tolerance = 1e-6;
  options.logging_type = ceres::SILENT;
  ceres::GradientProblemSolver::Summary summary;
  // Ceres' tolerance is absolute, so the cost is scaled to 1 at the start; after a long way down it is small
  // against that, and a second round with the new scale ends at the slope that was asked for.
  for (int round = 0; round < 3; ++round) {
    const double scale = remembering(optimum.lens).value;
    const ceres::GradientProblem problem(new InverseSquare(remembering, bounds, scale));
    ceres::Solve(options, problem, optimum.lens.data(), &summary);
    if (remembering(optimum.lens).value < 1.5 * scale) break;
  }

  const SharpnessValue value = remembering(optimum.lens);
  optimum.sharpness = value.value;
  optimum.gradient = value.gradient / value.value;
  optimum.evaluations = evaluations;
  optimum.reason = summary.message;
  const double slope_per_D = optimum.gradient.lpNorm<Eigen::Infinity>();
  const bool flat = slope_per_D <= settings.accepted_gradient_per_D;
  if (!flat)
    optimum.reason += fmt::format("; sharpness still changes by {:.2g} per dioptre there", slope_per_D);
  optimum.converged = summary.termination_type == ceres::CONVERGENCE && optimum.lens.allFinite() &&
                      optimum.gradient.allFinite() && bounds.contain(optimum.lens) && flat;
  return optimum;
}

Eigen::MatrixXd curvature_of_log(const SharpnessFunction& sharpness, const Eigen::VectorXd& lens,
                                 double step) {
  const auto log_gradient = [&](const Eigen::VectorXd& at) -> Eigen::VectorXd {
    const SharpnessValue value = sharpness(at);
    return value.gradient / value.value;
  };
  Eigen::MatrixXd hessian(lens.size(), lens.size());
  for (Eigen::Index i = 0; i < lens.size(); ++i) {
    const Eigen::VectorXd offset = step * Eigen::VectorXd::Unit(lens.size(), i);
    hessian.col(i) = (log_gradient(lens + offset) - log_gradient(lens - offset)) / (2 * step);
  }
  return (hessian + hessian.transpose()) / 2;
}

}  // namespace emmetrope::correction
