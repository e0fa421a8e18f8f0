#pragma once
#include <Eigen/Core>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace emmetrope::correction {

/// Sharpness at a lens and its derivative by the lens's parameters.
struct SharpnessValue {
  double value = 0;
  Eigen::VectorXd gradient;
};
using SharpnessFunction = std::function<SharpnessValue(const Eigen::VectorXd& lens)>;

/// Box in which lenses are sought.
struct Bounds {
  Eigen::VectorXd lower, upper;
  bool contain(const Eigen::VectorXd& lens) const {
    return (lens.array() >= lower.array()).all() && (lens.array() <= upper.array()).all();
  }
};

struct OptimiserSettings {
  /// Error of focus that adds 1 to 1 / sharpness^2 (here of a pupil of 3.3 mm and a blur of 1 arcmin). It
  /// sets the length of the first step.
  double depth_of_focus_D = 0.35;
  /// The start may be many depths of focus away: what blurs it is then the error of focus, and the first step
  /// goes to the maximum of the parabola 1 / sharpness^2. From near, what blurs it may be what lenses of this
  /// kind leave, and it goes to that of ln(sharpness).
  bool from_afar = false;
  /// The ascent stays this near to its start in each parameter.
  double reach_D = std::numeric_limits<double>::infinity();
  /// Converged when the slope of ln(sharpness) is below this everywhere (1/D).
  double gradient_tolerance_per_D = 1e-3;
  /// Or when a step gains less than this fraction.
  double function_tolerance = 1e-5;
  int max_iterations = 15;
  /// Whatever Ceres says, a slope of ln(sharpness) above this is no optimum: a bound or a fault stopped the
  /// ascent.
  double accepted_gradient_per_D = 0.02;
  /// An ascent that comes this near to one of the maxima that are known ends there.
  std::vector<Eigen::VectorXd> known_maxima;
  double known_maximum_reach_D = 0;
};

/// For a coarse picture, whose optimum need only come near enough for a finer one to take over.
OptimiserSettings coarse_search();

struct Optimum {
  Eigen::VectorXd lens;
  double sharpness = 0;
  Eigen::VectorXd gradient;  ///< of ln(sharpness)
  int evaluations = 0;
  bool converged = false;  ///< Ceres says CONVERGENCE; finite, inside the bounds, and flat
  std::string reason;      ///< why not, for who asked for a lens
};

/// Ascends from `start` to a local maximum of sharpness with Ceres (BFGS, strong Wolfe line search). What is
/// minimised is 1 / sharpness^2: far from focus sharpness falls as the inverse of the blur's width, so this
/// is nearly a quadratic function of the lens's power over many dioptres. A trial that cannot be made
/// (`sharpness` throws Error (usage)) is stepped back from.
/// \throw Error (fault) when `start` is outside the bounds, (usage) when it cannot be made
Optimum ascend(const SharpnessFunction& sharpness, const Eigen::VectorXd& start, const Bounds& bounds,
               const OptimiserSettings& settings);

/// Of a symmetric matrix; of a curvature at a maximum the flattest direction's.
double largest_eigenvalue(const Eigen::MatrixXd& symmetric);

/// Matrix of second derivatives of ln(sharpness) at an optimum, from how its gradient changes over 0.05 D; one
/// evaluation a parameter. Where that change counts as flat in some direction, rays that pass from one texel
/// of the chart to the next make much of it: then over 0.25 D.
Eigen::MatrixXd curvature_of_log(const SharpnessFunction& sharpness, const Optimum& optimum);

}  // namespace emmetrope::correction
