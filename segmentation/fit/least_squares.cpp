#include "segmentation/fit/least_squares.hpp"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "pipeline/base/error.hpp"
#include "segmentation/fit/rician.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Expected magnitude and its derivative by the signal.
struct Expected {
  double value, d_signal;
};
Expected expected(double signal, double noise, bool with_noise) {
  if (!with_noise) return {signal, 1};
  const RicianMean m = rician(std::abs(signal) / noise);
  return {noise * m.mean, signal < 0 ? -m.derivative : m.derivative};
}

/// A sample's residual under the loss, r' = sign(r) sqrt(rho), whose square is the loss, and its derivative
/// by the signal (Triggs' correction of first order).
struct RobustResidual {
  double value, d_signal;
};
RobustResidual robust_residual(const FitProblem& problem, const Sample& sample, double signal) {
  const double c2 = problem.loss_scale * problem.loss_scale;
  const Expected e = expected(signal, problem.model->stacks()[sample.stack].noise, problem.rician);
  const double r = (sample.value - e.value) / sample.deviation;
  const double value = std::copysign(std::sqrt(c2 * std::log1p(r * r / c2)), r);
  const double d_r = std::abs(r) < 1e-6 ? 1 : r / (value * (1 + r * r / c2));
  return {value, -d_r * e.d_signal / sample.deviation};
}

/// Where a parameter still makes an eye. Beyond, the image is that at the limit and the prior alone pulls
/// back, so that a step over a limit costs the fit nothing else.
struct Limit {
  int parameter;
  double lower, upper;
};
constexpr std::array<Limit, 20> limits{{{cornea_c, 1 / 12.0, 1 / 5.0},
                                        {cornea_q, -1.5, 1},
                                        {cornea_q_split, -0.4, 0.4},
                                        {cornea_thickness, 0.2, 1.2},
                                        {cornea_back_ratio, 0.65, 1},
                                        {anterior_chamber_depth, 1.2, 7},
                                        {lens_thickness, 2, 7},
                                        {lens_anterior_radius, 4, 30},
                                        {lens_posterior_radius, 3, 15},
                                        {lens_anterior_q, -12, 5},
                                        {lens_posterior_q, -6, 5},
                                        {globe_x, 6, 18},
                                        {globe_y, 6, 18},
                                        {globe_z, 6, 18},
                                        {wall_lateral, 0.2, 4},
                                        {wall_axial, 0.2, 4},
                                        {wall_inner_share, 0.1, 0.9},
                                        {iris_half_thickness, 0.05, 0.4},
                                        {pupil_radius, 0.4, 5},
                                        // A thin lid far darker than air passes for a thicker cornea.
                                        {lid, -0.05, std::numeric_limits<double>::infinity()}}};

VectorXd within_limits(VectorXd parameters) {
  for (const Limit& limit : limits)
    parameters[limit.parameter] = std::clamp(parameters[limit.parameter], limit.lower, limit.upper);
  return parameters;
}

/// J'J = L L' of the moved combinations, L^-1 J'r, and what of the cost no step can remove.
struct Condensed {
  MatrixXd factor;
  VectorXd residual;
  double rest;
};
Condensed condense(const NormalEquations& equations, const Basis& basis) {
  const MatrixXd hessian =
      basis.transpose() * (equations.hessian.selfadjointView<Eigen::Lower>() * MatrixXd(basis));
  const VectorXd gradient = basis.transpose() * equations.gradient;
  Eigen::LLT<MatrixXd> factor(hessian);
  if (factor.info() != Eigen::Success) throw no_result_error("the fit's equations are singular");
  Condensed condensed{factor.matrixL(), factor.matrixL().solve(gradient), 0};
  condensed.rest = std::sqrt(std::max(2 * equations.cost - condensed.residual.squaredNorm(), 0.0));
  return condensed;
}

/// Rows of the Jacobian, some at a time, over the parameters that any of them touches: voxels that follow each other
/// touch nearly the same ones, and a product of dense blocks is several times as fast as a sum of sparse rows.
class RowBlock {
 public:
  explicit RowBlock(int size)
      : column_(static_cast<std::size_t>(size), -1), rows_(height, size), residuals_(height) {}

  /// \param times  of the row, which becomes the residual's derivative
  void add(const SparseRow& row, double times, double residual, NormalEquations& out) {
    for (const int i : row.touched()) {
      const double value = times * row[i];
      if (value == 0) continue;
      int& column = column_[static_cast<std::size_t>(i)];
      if (column < 0) {
        column = static_cast<int>(touched_.size());
        touched_.push_back(i);
        rows_.col(column).setZero();
      }
      rows_(count_, column) = value;
    }
    residuals_[count_] = residual;
    if (++count_ == height) flush(out);
  }

  /// Adds what is left over.
  void flush(NormalEquations& out) {
    const auto width = static_cast<Eigen::Index>(touched_.size());
    const auto rows = rows_.topLeftCorner(count_, width);
    product_.setZero(width, width);
    product_.selfadjointView<Eigen::Lower>().rankUpdate(rows.transpose());
    const VectorXd gradient = rows.transpose() * residuals_.head(count_);
    for (Eigen::Index j = 0; j < width; ++j) {
      const int a = touched_[static_cast<std::size_t>(j)];
      out.gradient[a] += gradient[j];
      for (Eigen::Index i = j; i < width; ++i) {
        const int b = touched_[static_cast<std::size_t>(i)];
        out.hessian(std::max(a, b), std::min(a, b)) += product_(i, j);
      }
      column_[static_cast<std::size_t>(a)] = -1;
    }
    touched_.clear();
    count_ = 0;
  }

 private:
  static constexpr Eigen::Index height = 32;
  std::vector<int> column_;   ///< of a parameter; -1: no row touches it
  std::vector<int> touched_;  ///< the columns' parameters
  MatrixXd rows_, product_;
  VectorXd residuals_;
  Eigen::Index count_ = 0;
};

/// The terms of the cost: each adds its share, and where asked for its derivatives.
void add_samples(const FitProblem& problem, const ForwardModel::AtParameters& at, bool derivatives,
                 NormalEquations& out) {
  const int size = problem.model->layout().size();
  SparseRow row(size);
  RowBlock block(size);
  for (const Sample& sample : problem.samples) {
    const double signal = at.intensity(sample, derivatives ? &row : nullptr);
    const RobustResidual r = robust_residual(problem, sample, signal);
    out.cost += r.value * r.value / 2;
    if (derivatives) block.add(row, r.d_signal, r.value, out);
  }
  if (derivatives) block.flush(out);
}

void add_limbus(const FitProblem& problem, const ForwardModel::AtParameters& at, bool derivatives,
                NormalEquations& out) {
  if (!(problem.limbus_sigma_mm > 0)) return;
  SparseRow row(problem.model->layout().size());
  for (int quadrant = 0; quadrant < 4; ++quadrant) {
    const double r = at.limbus_misfit(quadrant, derivatives ? &row : nullptr) / problem.limbus_sigma_mm;
    out.cost += r * r / 2;
    if (!derivatives) continue;
    for (const int j : row.touched()) {
      const double v = row[j] / problem.limbus_sigma_mm;
      out.gradient[j] += v * r;
      for (const int i : row.touched())
        if (i >= j) out.hessian(i, j) += v * row[i] / problem.limbus_sigma_mm;
    }
  }
}

/// Two tissues are equally bright but for sigma.
void add_alike(Parameter first, Parameter second, double sigma, const VectorXd& parameters, bool derivatives,
               NormalEquations& out) {
  const double per_sigma = 1 / sigma, deviation = per_sigma * (parameters[first] - parameters[second]);
  out.cost += deviation * deviation / 2;
  if (!derivatives) return;
  out.gradient[first] += per_sigma * deviation;
  out.gradient[second] -= per_sigma * deviation;
  out.hessian(first, first) += per_sigma * per_sigma;
  out.hessian(second, second) += per_sigma * per_sigma;
  out.hessian(std::max(first, second), std::min(first, second)) -=
      per_sigma * per_sigma;  // the lower triangle
}

/// Retina and choroid are not darker than sclera: below nought the prior is this narrow, and has no kink in which
/// solutions would end apart.
void add_inverted_layering(const Priors& priors, const VectorXd& parameters, bool derivatives,
                           NormalEquations& out) {
  const double layering = std::min(parameters[wall_layering], 0.0);
  if (layering == 0) return;
  constexpr double sigma = 0.02;
  const double information = 1 / (sigma * sigma) - 1 / std::pow(priors.sigma[wall_layering], 2);
  out.cost += information * layering * layering / 2;
  if (!derivatives) return;
  out.gradient[wall_layering] += information * layering;
  out.hessian(wall_layering, wall_layering) += information;
}

/// An inner layer as bright as the vitreous has no border to it: the globe would be smaller by as much as one likes. How far
/// beyond its limit it may be, in the unit of intensities, was chosen.
void add_bright_inner_layer(const Priors& priors, const VectorXd& parameters, bool derivatives,
                            NormalEquations& out) {
  if (!std::isfinite(priors.brightest_inner_layer)) return;
  constexpr double sigma = 0.03;
  const double outer_share = 1 - parameters[wall_inner_share], layering = parameters[wall_layering];
  const double excess =
      (parameters[wall] + outer_share * layering - priors.brightest_inner_layer * parameters[vitreous]) /
      sigma;
  if (!(excess > 0)) return;
  out.cost += excess * excess / 2;
  if (!derivatives) return;
  const std::array<std::pair<int, double>, 4> slopes{{{wall_inner_share, -layering / sigma},
                                                      {vitreous, -priors.brightest_inner_layer / sigma},
                                                      {wall, 1 / sigma},
                                                      {wall_layering, outer_share / sigma}}};
  for (const auto& [i, by_i] : slopes) {
    out.gradient[i] += excess * by_i;
    for (const auto& [j, by_j] : slopes)
      if (i >= j) out.hessian(i, j) += by_i * by_j;
  }
}

void add_priors(const FitProblem& problem, const VectorXd& parameters, bool derivatives,
                NormalEquations& out) {
  const Priors& priors = problem.priors;
  const VectorXd per_sigma = priors.sigma.cwiseInverse();
  VectorXd deviation = (parameters - priors.mean).cwiseProduct(per_sigma);
  deviation[cornea_c] =
      (parameters[cornea_c] - expected_curvature(priors, parameters[axial_length])) * per_sigma[cornea_c];
  const MatrixXd& information = priors.corneal_form_information;
  const int form = problem.model->layout().corneal_form();
  const auto terms = static_cast<int>(information.rows());
  VectorXd score = deviation;  // by the information
  score.segment(form, terms) = information * deviation.segment(form, terms);
  out.cost += deviation.dot(score) / 2;
  if (!derivatives) return;
  out.gradient += score.cwiseProduct(per_sigma);
  const double d_length = -priors.curvature_per_axial_length * per_sigma[cornea_c];  // of deviation[cornea_c]
  out.gradient[axial_length] += score[cornea_c] * d_length;
  out.hessian(axial_length, axial_length) += d_length * d_length;
  static_assert(cornea_c < axial_length, "of the symmetric matrix the lower triangle is filled");
  out.hessian(axial_length, cornea_c) += d_length * per_sigma[cornea_c];
  VectorXd alone = per_sigma.cwiseAbs2();
  alone.segment(form, terms).setZero();
  out.hessian.diagonal() += alone;
  const VectorXd form_per_sigma = per_sigma.segment(form, terms);
  out.hessian.block(form, form, terms, terms) +=
      form_per_sigma.asDiagonal() * information * form_per_sigma.asDiagonal();
}

/// The whole fit as one residual block with as many residuals as parameters, and one constant.
class CondensedCost : public ceres::CostFunction {
 public:
  CondensedCost(const FitProblem& problem, const VectorXd& start, const Basis& basis)
      : problem_(problem), start_(start), basis_(basis) {
    set_num_residuals(static_cast<int>(basis.cols()) + 1);
    mutable_parameter_block_sizes()->push_back(static_cast<int>(basis.cols()));
  }

  bool Evaluate(double const* const* z, double* residuals, double** jacobians) const override {
    const Eigen::Index n = basis_.cols();
    const VectorXd parameters = start_ + basis_ * Eigen::Map<const VectorXd>(z[0], n);
    const bool derivatives = jacobians && jacobians[0];
    const NormalEquations equations = evaluate(problem_, parameters, derivatives);
    if (!std::isfinite(equations.cost)) return false;
    Eigen::Map<VectorXd> r(residuals, n + 1);
    if (!derivatives) {
      // Only the sum of squares counts here.
      r.setZero();
      r[n] = std::sqrt(2 * equations.cost);
      return true;
    }
    const Condensed condensed = condense(equations, basis_);
    r.head(n) = condensed.residual;
    r[n] = condensed.rest;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> jacobian(jacobians[0],
                                                                                                n + 1, n);
    jacobian.topRows(n) = condensed.factor.transpose();
    jacobian.row(n).setZero();
    return true;
  }

 private:
  const FitProblem& problem_;
  const VectorXd& start_;
  const Basis& basis_;
};

}  // namespace

double residual(const FitProblem& problem, const ForwardModel::AtParameters& at, const Sample& sample) {
  const double noise = problem.model->stacks()[sample.stack].noise;
  return (sample.value - expected(at.intensity(sample, nullptr), noise, problem.rician).value) /
         sample.deviation;
}

NormalEquations evaluate(const FitProblem& problem, const VectorXd& parameters, bool derivatives) {
  const int size = problem.model->layout().size();
  const VectorXd within = within_limits(parameters);
  const ForwardModel::AtParameters at(*problem.model, within);
  NormalEquations out;
  if (derivatives) {
    out.hessian = MatrixXd::Zero(size, size);
    out.gradient = VectorXd::Zero(size);
  }
  add_samples(problem, at, derivatives, out);
  add_limbus(problem, at, derivatives, out);
  add_alike(cornea, wall, problem.priors.cornea_like_wall_sigma, parameters, derivatives, out);
  if (derivatives) {
    for (const Limit& limit : limits) {
      if (within[limit.parameter] == parameters[limit.parameter]) continue;
      out.gradient[limit.parameter] = 0;
      out.hessian.row(limit.parameter).setZero();
      out.hessian.col(limit.parameter).setZero();
    }
  }
  add_priors(problem, parameters, derivatives, out);
  add_inverted_layering(problem.priors, parameters, derivatives, out);
  add_bright_inner_layer(problem.priors, parameters, derivatives, out);
  return out;
}

Basis select_parameters(int size, const std::vector<int>& active) {
  Basis basis(size, static_cast<int>(active.size()));
  for (std::size_t i = 0; i < active.size(); ++i) basis.insert(active[i], static_cast<int>(i)) = 1;
  basis.makeCompressed();
  return basis;
}

LinearRows linearise(const FitProblem& problem, const VectorXd& parameters, const Basis& basis) {
  const ForwardModel::AtParameters at(*problem.model, parameters);
  std::vector<int> column(problem.model->layout().size(), -1);
  for (int j = 0; j < basis.outerSize(); ++j)
    for (Basis::InnerIterator entry(basis, j); entry; ++entry) column[entry.row()] = j;
  const auto count = static_cast<Eigen::Index>(problem.samples.size());
  LinearRows rows{Eigen::SparseMatrix<double, Eigen::RowMajor>(count, basis.cols()), VectorXd(count)};
  SparseRow row(problem.model->layout().size());
  std::vector<std::pair<int, double>> entries;
  for (Eigen::Index i = 0; i < count; ++i) {
    const Sample& sample = problem.samples[static_cast<std::size_t>(i)];
    const RobustResidual r = robust_residual(problem, sample, at.intensity(sample, &row));
    rows.residual[i] = r.value;
    entries.clear();
    for (const int parameter : row.touched())
      if (column[parameter] >= 0) entries.emplace_back(column[parameter], r.d_signal * row[parameter]);
    std::sort(entries.begin(), entries.end());
    rows.jacobian.startVec(i);
    for (const auto& [j, value] : entries) rows.jacobian.insertBack(i, j) = value;
  }
  rows.jacobian.finalize();
  return rows;
}  // NOLINT(clang-analyzer-unix.Malloc): the analyser loses sight of Eigen's memory in what is returned

SolveResult solve(const FitProblem& problem, const VectorXd& start, const Basis& basis,
                  const SolveLimits& stop) {
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  CondensedCost cost(problem, start, basis);
  ceres::Problem ceres_problem(ownership);
  VectorXd z = VectorXd::Zero(basis.cols());
  ceres_problem.AddResidualBlock(&cost, nullptr, z.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = stop.iterations;
  options.function_tolerance = stop.cost_tolerance;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  if (!summary.IsSolutionUsable()) throw no_result_error("the fit failed: " + summary.message);
  SolveResult result;
  result.parameters = within_limits(start + basis * z);
  result.cost = summary.final_cost;
  result.iterations = static_cast<int>(summary.iterations.size()) - 1;
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  return result;
}

MatrixXd covariance(const FitProblem& problem, const VectorXd& parameters, const Basis& basis) {
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  CondensedCost cost(problem, parameters, basis);
  ceres::Problem ceres_problem(ownership);
  VectorXd z = VectorXd::Zero(basis.cols());
  ceres_problem.AddResidualBlock(&cost, nullptr, z.data());
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance ceres_covariance(options);
  if (!ceres_covariance.Compute(std::vector<const double*>{z.data()}, &ceres_problem))
    throw no_result_error("the fit's parameters are not determined by image and priors (rank deficient)");
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> result(basis.cols(), basis.cols());
  ceres_covariance.GetCovarianceBlock(z.data(), z.data(), result.data());
  return result;
}

}  // namespace emmetrope::segmentation
