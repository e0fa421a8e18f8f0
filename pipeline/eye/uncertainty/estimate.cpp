#include "pipeline/eye/uncertainty/estimate.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What the images must have shown for an eye to be measured at all.
constexpr const char* required[] = {"cornea_c_per_mm", "cornea_j0_per_mm",          "cornea_j45_per_mm",
                                    "axial_length_mm", "anterior_chamber_depth_mm", "lens_thickness_mm"};

/// Of what a population's prior alone tells, how many times as far an eye may be as a normal distribution
/// says: 2.6 % of eyes have more than 3 D of corneal cylinder (Hoffmann and Huetz 2010).
constexpr double long_tail = 2;

bool is_named(const ParametricEye& eye, const std::string& name) {
  return std::find(eye.parameter_names.begin(), eye.parameter_names.end(), name) != eye.parameter_names.end();
}

void add_prior(ParametricEye& eye, const PopulationPrior& prior) {
  const Index n = eye.covariance.rows();
  MatrixXd covariance = MatrixXd::Zero(n + 1, n + 1);
  covariance.topLeftCorner(n, n) = eye.covariance;
  covariance(n, n) = prior.sigma * prior.sigma;
  eye.covariance = covariance;
  eye.parameter_names.emplace_back(prior.parameter);
  eye.source[prior.parameter] = "prior";
}

void check_covariance(const ParametricEye& eye) {
  const MatrixXd& p = eye.covariance;
  if (p.rows() != p.cols() || p.rows() != static_cast<Index>(eye.parameter_names.size()))
    throw input_error("fitted eye: the covariance's size is not that of its list of parameters");
  if (!p.allFinite()) throw input_error("fitted eye: the covariance holds numbers that are not finite");
  const VectorXd sigma = p.diagonal().cwiseMax(0).cwiseSqrt();
  for (Index i = 0; i < sigma.size(); ++i) {
    if (!(sigma[i] > 0)) throw input_error("fitted eye: '" + eye.parameter_names[i] + "' has no variance");
  }
  // Judged as correlations, since the parameters differ in their units.
  const MatrixXd scaled = sigma.cwiseInverse().asDiagonal() * p * sigma.cwiseInverse().asDiagonal();
  const MatrixXd asymmetry = scaled - scaled.transpose();
  if (asymmetry.cwiseAbs().maxCoeff() > 1e-6)
    throw input_error("fitted eye: the covariance is not symmetric");
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
  if (eigen.eigenvalues().minCoeff() < -1e-6)
    throw input_error("fitted eye: the covariance is not positive semidefinite");
}

}  // namespace

const std::vector<PopulationPrior>& population_priors() {
  static const std::vector<PopulationPrior> priors{
      {"cornea_q", 0.12, "Dubbelman, Sicam and van der Heijde 2006"},
      {"cornea_q_split", 0.05, "Zhang et al. 2011, 1052 subjects"},
      {"cornea_thickness_mm", 0.035, "Doughty and Zaman 2000: 0.535 +- 0.031 mm"},
      {"cornea_back_ratio", 0.015, "Dubbelman, Sicam and van der Heijde 2006: 0.81 to 0.84"},
      {"lens_anterior_radius_mm", 1.5, "Dubbelman and van der Heijde 2001"},
      {"lens_posterior_radius_mm", 0.6, "Dubbelman and van der Heijde 2001"},
      {"lens_anterior_q", 1.5, "schematic eyes, and lenses in vivo (Ortiz et al. 2012)"},
      {"lens_posterior_q", 1.0, "Dubbelman and van der Heijde 2001"},
      {"lens_decentre_x_mm", 0.25, "Rosales and Marcos 2006"},
      {"lens_decentre_y_mm", 0.25, "Rosales and Marcos 2006"},
      {"lens_tilt_x_deg", 3.0, "Rosales and Marcos 2006"},
      {"lens_tilt_y_deg", 3.0, "Rosales and Marcos 2006"},
  };
  return priors;
}

double Propagated::sigma(Index i) const { return std::sqrt(std::max(0.0, covariance(i, i))); }

Measured root_sum_square(const Propagated& terms) {
  constexpr std::size_t draws = 4000;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(terms.covariance);
  const MatrixXd spread = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> roots(draws);
  for (double& root : roots)
    root = (terms.value +
            spread * VectorXd::NullaryExpr(terms.value.size(), [&] {
              return normal(random);
            })).norm();
  std::sort(roots.begin(), roots.end());
  const auto quantile = [&](double share) { return roots[static_cast<std::size_t>(share * (draws - 1))]; };
  Index largest = 0;
  terms.covariance.diagonal().maxCoeff(&largest);
  return {quantile(0.5), {quantile(0.025), quantile(0.975)}, terms.source[largest]};
}

EyeEstimate::EyeEstimate(ParametricEye fitted) : eye_(std::move(fitted)) {
  for (const char* name : required) {
    if (!is_named(eye_, name))
      throw input_error(std::string("fitted eye: '") + name + "' is not among the fitted parameters");
  }
  for (const PopulationPrior& prior : population_priors()) {
    if (!is_named(eye_, prior.parameter)) add_prior(eye_, prior);
  }
  check_covariance(eye_);
}

void EyeEstimate::add_scale_prior(double relative_sd) {
  const auto ends_with = [](const std::string& name, const std::string& end) {
    return name.size() >= end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0;
  };
  VectorXd along =
      VectorXd::Zero(eye_.covariance.rows());  // derivative of each parameter by the scale; its unit tells
  for (Index i = 0; i < along.size(); ++i) {
    const std::string& name = eye_.parameter_names[i];
    if (ends_with(name, "_per_mm"))
      along[i] = -eye_.get(name);
    else if (ends_with(name, "_mm") && name.rfind("apex_", 0) != 0 && name.rfind("displacement_", 0) != 0)
      along[i] = eye_.get(name);
  }
  eye_.covariance += relative_sd * relative_sd * along * along.transpose();
}

NormalDistribution EyeEstimate::parameters() const {
  VectorXd mean(static_cast<Index>(eye_.parameter_names.size()));
  for (Index i = 0; i < mean.size(); ++i) mean[i] = eye_.get(eye_.parameter_names[i]);
  return {std::move(mean), eye_.covariance};
}

VectorFunction EyeEstimate::of_parameters(const Functional& functional) const {
  return [eye = eye_, current = parameters().mean, functional](const VectorXd& values) mutable {
    for (Index i = 0; i < values.size(); ++i)
      if (values[i] != current[i]) eye.set(eye.parameter_names[i], values[i]);
    current = values;
    return functional(eye);
  };
}

Propagated EyeEstimate::propagate(const Functional& functional) const {
  const MatrixXd j = jacobian(parameters(), of_parameters(functional));
  Propagated result{functional(eye_), j * eye_.covariance * j.transpose(), {}};
  for (Index row = 0; row < j.rows(); ++row) {
    std::map<std::string, double> share;
    for (Index i = 0; i < j.cols(); ++i) {
      const auto source = eye_.source.find(eye_.parameter_names[i]);
      share[source == eye_.source.end() ? "mri" : source->second] +=
          j(row, i) * j(row, i) * (steps_.empty() ? eye_.covariance : steps_.front().covariance_before)(i, i);
    }
    const auto largest = std::max_element(share.begin(), share.end(),
                                          [](const auto& a, const auto& b) { return a.second < b.second; });
    std::string source = largest->first;
    for (std::size_t s = 0; s < steps_.size(); ++s) {
      const MatrixXd& after = s + 1 < steps_.size() ? steps_[s + 1].covariance_before : eye_.covariance;
      const double before = j.row(row).dot(steps_[s].covariance_before * j.row(row).transpose());
      if (j.row(row).dot(after * j.row(row).transpose()) < before / 2) source = steps_[s].source;
    }
    result.source.push_back(source);
  }
  return result;
}

double EyeEstimate::surprise(const ExternalMeasurement& measurement) const {
  NormalDistribution doubted = parameters();
  for (Index i = 0; i < doubted.mean.size(); ++i) {
    const auto source = eye_.source.find(eye_.parameter_names[i]);
    if (source == eye_.source.end() || source->second != "prior") continue;
    doubted.covariance.row(i) *= long_tail;
    doubted.covariance.col(i) *= long_tail;
  }
  return condition(doubted, of_parameters(measurement.of_eye), measurement.value, measurement.covariance);
}

double EyeEstimate::assimilate(const ExternalMeasurement& measurement) {
  const double distance = surprise(measurement);
  NormalDistribution learnt = parameters();
  steps_.push_back({measurement.source, learnt.covariance});
  condition(learnt, of_parameters(measurement.of_eye), measurement.value, measurement.covariance);
  for (Index i = 0; i < learnt.mean.size(); ++i) eye_.set(eye_.parameter_names[i], learnt.mean[i]);
  eye_.covariance = std::move(learnt.covariance);
  return distance;
}

}  // namespace emmetrope
