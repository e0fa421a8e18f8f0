#include "correction/search/optimise.hpp"

#include <ceres/first_order_function.h>
#include <ceres/gradient_problem.h>
#include <ceres/gradient_problem_solver.h>
#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>

#include "pipeline/base/error.hpp"

namespace emmetrope::correction {
namespace {

/// Of ln(sharpness), the steepest way; above zero to divide by.
double slope_per_D(const SharpnessValue& value) {
  return std::max(value.gradient.norm() / value.value, 1e-9);
}

/// (S_start / S)^2 over (lens - start) / scale, times what makes its gradient 1 long at the start: Ceres'
/// first step, which is minus the gradient, then goes one scale.
class InverseSquare : public ceres::FirstOrderFunction {
 public:
  InverseSquare(const SharpnessFunction& sharpness, const Bounds& bounds, Eigen::VectorXd start,
                const SharpnessValue& at_start, double scale_D)
      : sharpness_(sharpness),
        bounds_(bounds),
        start_(std::move(start)),
        start_sharpness_(at_start.value),
        scale_D_(scale_D),
        unit_(1 / (2 * slope_per_D(at_start) * scale_D)) {}

  Eigen::VectorXd lens(const double* parameters) const {
    return start_ + scale_D_ * Eigen::Map<const Eigen::VectorXd>(parameters, NumParameters());
  }

  bool Evaluate(const double* parameters, double* cost, double* gradient) const override {
    const Eigen::VectorXd at = lens(parameters);
    // Where it is false the line search takes a shorter step.
    if (!bounds_.contain(at)) return false;
    SharpnessValue value;
    try {
      value = sharpness_(at);
    } catch (const Error& error) {
      if (error.status() != ExitStatus::usage) throw;
      return false;  // no such lens can be made
    }
    if (!(value.value > 0) || !value.gradient.allFinite()) return false;
    *cost = unit_ * std::pow(start_sharpness_ / value.value, 2);
    if (gradient)
      Eigen::Map<Eigen::VectorXd>(gradient, NumParameters()) =
          -2 * *cost * scale_D_ / value.value * value.gradient;
    return true;
  }
  int NumParameters() const override { return static_cast<int>(start_.size()); }

 private:
  const SharpnessFunction& sharpness_;
  const Bounds& bounds_;
  Eigen::VectorXd start_;
  double start_sharpness_, scale_D_, unit_;
};

/// Ends an ascent near a maximum that is known.
class AtKnownMaximum : public ceres::IterationCallback {
 public:
  AtKnownMaximum(const OptimiserSettings& settings, const InverseSquare& cost, const Eigen::VectorXd& moved)
      : settings_(settings), cost_(cost), moved_(moved) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    const Eigen::VectorXd lens = cost_.lens(moved_.data());
    const bool near = std::any_of(settings_.known_maxima.begin(), settings_.known_maxima.end(),
                                  [&](const Eigen::VectorXd& maximum) {
                                    return (maximum - lens).norm() < settings_.known_maximum_reach_D;
                                  });
    return near ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  const OptimiserSettings& settings_;
  const InverseSquare& cost_;
  const Eigen::VectorXd& moved_;
};

/// How far the maximum is, were 1/S^2 (from afar) or ln(S) a parabola as the depth of focus says.
double distance_to_maximum_D(const SharpnessValue& value, const OptimiserSettings& settings) {
  constexpr double nearest_D = 1e-3, farthest_D = 10;
  const double by_log_D = slope_per_D(value) * std::pow(settings.depth_of_focus_D, 2);
  return std::clamp(settings.from_afar ? by_log_D / std::pow(value.value, 2) : by_log_D, nearest_D,
                    farthest_D);
}

/// Evaluations are costly and Ceres asks again for points it has seen.
class RememberedSharpness {
 public:
  explicit RememberedSharpness(const SharpnessFunction& sharpness) : sharpness_(sharpness) {}
  const SharpnessValue& operator()(const Eigen::VectorXd& lens) {
    if (lens_.size() == 0 || lens_ != lens) {
      value_ = sharpness_(lens);
      lens_ = lens;
      ++evaluations_;
    }
    return value_;
  }
  int evaluations() const { return evaluations_; }

 private:
  const SharpnessFunction& sharpness_;
  Eigen::VectorXd lens_;
  SharpnessValue value_;
  int evaluations_ = 0;
};

ceres::GradientProblemSolver::Options bfgs_options(const OptimiserSettings& settings) {
  ceres::GradientProblemSolver::Options options;
  options.line_search_direction_type = ceres::BFGS;
  options.line_search_type = ceres::WOLFE;
  options.use_approximate_eigenvalue_bfgs_scaling = true;
  options.max_num_iterations = settings.max_iterations;
  options.function_tolerance = settings.function_tolerance;
  options.parameter_tolerance = 1e-6;
  options.logging_type = ceres::SILENT;
  options.update_state_every_iteration = true;  // for the callback
  return options;
}

/// Ceres' tolerance is absolute and the cost scaled by its start; after a long way down it is small against
/// that, and a second round with the new scale ends at the slope that was asked for.
ceres::GradientProblemSolver::Summary ascend_in_rounds(const SharpnessFunction& sharpness,
                                                       Eigen::VectorXd& lens, const Bounds& bounds,
                                                       const OptimiserSettings& settings) {
  ceres::GradientProblemSolver::Options options = bfgs_options(settings);
  ceres::GradientProblemSolver::Summary summary;
  for (int round = 0; round < 3; ++round) {
    const SharpnessValue start_value = sharpness(lens);
    const double scale_D = distance_to_maximum_D(start_value, settings);
    auto* cost = new InverseSquare(sharpness, bounds, lens, start_value, scale_D);
    const ceres::GradientProblem problem(cost);  // owns the cost
    options.gradient_tolerance = settings.gradient_tolerance_per_D / slope_per_D(start_value);
    Eigen::VectorXd moved = Eigen::VectorXd::Zero(lens.size());
    AtKnownMaximum at_known_maximum(settings, *cost, moved);
    options.callbacks = {&at_known_maximum};
    ceres::Solve(options, problem, moved.data(), &summary);
    lens = cost->lens(moved.data());
    if (summary.termination_type == ceres::USER_SUCCESS) break;
    if (sharpness(lens).value < 1.1 * start_value.value) break;
  }
  return summary;
}

Eigen::MatrixXd curvature_over(const SharpnessFunction& sharpness, const Optimum& optimum, double step_D) {
  const Eigen::Index n = optimum.lens.size();
  Eigen::MatrixXd hessian(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const SharpnessValue beside = sharpness(optimum.lens + step_D * Eigen::VectorXd::Unit(n, i));
    hessian.col(i) = (beside.gradient / beside.value - optimum.gradient) / step_D;
  }
  return (hessian + hessian.transpose()) / 2;
}

}  // namespace

double largest_eigenvalue(const Eigen::MatrixXd& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric).eigenvalues().maxCoeff();
}

OptimiserSettings coarse_search() {
  OptimiserSettings settings;
  settings.from_afar = true;
  settings.gradient_tolerance_per_D = 0.05;
  settings.function_tolerance = 1e-3;
  settings.max_iterations = 12;
  return settings;
}

Optimum ascend(const SharpnessFunction& sharpness, const Eigen::VectorXd& start, const Bounds& bounds,
               const OptimiserSettings& settings) {
  if (!bounds.contain(start))
    throw Error(ExitStatus::fault, "a start of the lens search is outside its bounds");
  const Bounds reached{bounds.lower.cwiseMax((start.array() - settings.reach_D).matrix()),
                       bounds.upper.cwiseMin((start.array() + settings.reach_D).matrix())};
  RememberedSharpness remembered(sharpness);
  Optimum optimum;
  optimum.lens = start;
  const auto summary = ascend_in_rounds(std::ref(remembered), optimum.lens, reached, settings);
  const SharpnessValue value = remembered(optimum.lens);
  optimum.sharpness = value.value;
  optimum.gradient = value.gradient / value.value;
  optimum.evaluations = remembered.evaluations();
  const double steepest_per_D = optimum.gradient.lpNorm<Eigen::Infinity>();
  if (!reached.contain(optimum.lens) || !optimum.gradient.allFinite())
    optimum.reason = "there is no sharpness where it ended";
  else if (steepest_per_D > settings.accepted_gradient_per_D)
    optimum.reason =
        fmt::format("sharpness still changes by {:.2g} per dioptre where it ended", steepest_per_D);
  else if (summary.termination_type != ceres::CONVERGENCE)
    optimum.reason = "its steps led to no summit";
  optimum.converged = optimum.reason.empty();
  return optimum;
}

Eigen::MatrixXd curvature_of_log(const SharpnessFunction& sharpness, const Optimum& optimum) {
  constexpr double short_step_D = 0.05, long_step_D = 0.25, least_change_per_D = 0.02;
  const Eigen::MatrixXd close = curvature_over(sharpness, optimum, short_step_D);
  return -largest_eigenvalue(close) * short_step_D < least_change_per_D
             ? curvature_over(sharpness, optimum, long_step_D)
             : close;
}

}  // namespace emmetrope::correction
