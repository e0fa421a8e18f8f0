#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "pipeline/base/ends_with.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What the images must have shown for an eye to be measured at all.
constexpr const char* required[] = {"cornea_c_per_mm", "cornea_j0_per_mm",          "cornea_j45_per_mm",
                                    "axial_length_mm", "anterior_chamber_depth_mm", "lens_thickness_mm"};
/// What a fit may leave to the population.
constexpr const char* optional[] = {
    "cornea_q",           "cornea_q_split",          "cornea_thickness_mm",
    "cornea_back_ratio",  "lens_anterior_radius_mm", "lens_posterior_radius_mm",
    "lens_anterior_q",    "lens_posterior_q",        "lens_decentre_x_mm",
    "lens_decentre_y_mm", "lens_tilt_x_deg",         "lens_tilt_y_deg"};

bool is_named(const ParametricEye& eye, const std::string& name) {
  return std::find(eye.parameter_names.begin(), eye.parameter_names.end(), name) != eye.parameter_names.end();
}

void add_prior(ParametricEye& eye, const PopulationValue& prior) {
  const Index n = eye.covariance.rows();
  MatrixXd covariance = MatrixXd::Zero(n + 1, n + 1);
  covariance.topLeftCorner(n, n) = eye.covariance;
  covariance(n, n) = prior.sigma * prior.sigma;
  eye.covariance = covariance;
  eye.parameter_names.emplace_back(prior.parameter);
  eye.source[prior.parameter] = "prior";
}

/// Images, or what was known before they were seen; else an instrument.
bool is_of_images(const std::string& source) {
  return source == "prior" || source.rfind("mri", 0) == 0 || source.rfind("labels", 0) == 0;
}

double quantile_of_sorted(const std::vector<double>& ascending, double share) {
  return ascending[static_cast<std::size_t>(share * static_cast<double>(ascending.size() - 1))];
}

void check_covariance(const ParametricEye& eye) {
  const MatrixXd& p = eye.covariance;
  if (p.rows() != p.cols() || p.rows() != static_cast<Index>(eye.parameter_names.size()))
    throw input_error("measured eye: the covariance's size is not that of its list of parameters");
  if (!p.allFinite()) throw input_error("measured eye: the covariance holds numbers that are not finite");
  // Judged as correlations, since the parameters differ in their units.
  const VectorXd sigma = p.diagonal().cwiseMax(0).cwiseSqrt();
  const VectorXd scale = sigma.unaryExpr([](double s) { return s > 0 ? 1 / s : 0; });
  const MatrixXd scaled = scale.asDiagonal() * p * scale.asDiagonal();
  const MatrixXd asymmetry = scaled - scaled.transpose();
  if (asymmetry.cwiseAbs().maxCoeff() > 1e-6)
    throw input_error("measured eye: the covariance is not symmetric");
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
  if (eigen.eigenvalues().minCoeff() < -1e-6)
    throw input_error("measured eye: the covariance is not positive semidefinite");
}

}  // namespace

double Propagated::sigma(Index i) const { return std::sqrt(std::max(0.0, covariance(i, i))); }

MatrixXd Propagated::draws() const {
  constexpr Index count = 4000;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance);
  const MatrixXd spread = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const MatrixXd standard = MatrixXd::NullaryExpr(value.size(), count, [&] { return normal(random); });
  return (spread * standard).colwise() + value;
}

std::array<double, 2> ci95_of(std::vector<double> draws) {
  std::sort(draws.begin(), draws.end());
  return {quantile_of_sorted(draws, 0.025), quantile_of_sorted(draws, 0.975)};
}

Measured root_sum_square(const Propagated& terms) {
  const VectorXd length = terms.draws().colwise().norm();
  std::vector<double> roots(length.begin(), length.end());
  std::sort(roots.begin(), roots.end());
  Index largest = 0;
  terms.covariance.diagonal().maxCoeff(&largest);
  const Origin& origin = terms.origin[static_cast<std::size_t>(largest)];
  return {quantile_of_sorted(roots, 0.5),
          {quantile_of_sorted(roots, 0.025), quantile_of_sorted(roots, 0.975)},
          origin.source,
          {},
          origin.image_share};
}

UncertainEye::UncertainEye(ParametricEye eye) : eye_(std::move(eye)) {
  for (const std::string& name : eye_.parameter_names)
    if (!has_parameter(eye_, name)) throw input_error("measured eye: no eye has a parameter '" + name + "'");
  check_covariance(eye_);
}

UncertainEye fitted_eye(ParametricEye fitted) {
  for (const char* name : required) {
    if (!is_named(fitted, name))
      throw input_error(std::string("measured eye: '") + name + "' is not among the fitted parameters");
  }
  for (Index i = 0; i < std::min(fitted.covariance.rows(), fitted.covariance.cols()); ++i)
    if (!(fitted.covariance(i, i) > 0)) throw input_error("measured eye: a fitted parameter has no variance");
  for (const char* name : optional)
    if (!is_named(fitted, name)) add_prior(fitted, population_value(name));
  return UncertainEye(std::move(fitted));
}

void UncertainEye::add_scale_prior(double relative_sd) {
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

NormalDistribution UncertainEye::parameters() const {
  VectorXd mean(static_cast<Index>(eye_.parameter_names.size()));
  for (Index i = 0; i < mean.size(); ++i) mean[i] = eye_.get(eye_.parameter_names[i]);
  return {std::move(mean), eye_.covariance};
}

Index UncertainEye::index_of(const std::string& parameter) const {
  const auto& names = eye_.parameter_names;
  const auto found = std::find(names.begin(), names.end(), parameter);
  if (found == names.end()) throw input_error("measured eye: parameter \"" + parameter + "\" is missing");
  return found - names.begin();
}

double UncertainEye::sigma(const std::string& parameter) const {
  const Index i = index_of(parameter);
  return std::sqrt(std::max(0.0, eye_.covariance(i, i)));
}

const std::string& UncertainEye::source(Index parameter) const {
  static const std::string images = "mri";
  const auto named = eye_.source.find(eye_.parameter_names[parameter]);
  return named == eye_.source.end() ? images : named->second;
}

ParametricEye UncertainEye::at(const VectorXd& values) const {
  ParametricEye eye = eye_;
  for (Index i = 0; i < values.size(); ++i) eye.set(eye_.parameter_names[i], values[i]);
  return eye;
}

VectorFunction UncertainEye::of_parameters(const Functional& functional) const {
  return [eye = eye_, current = parameters().mean, functional](const VectorXd& values) mutable {
    for (Index i = 0; i < values.size(); ++i)
      if (values[i] != current[i]) eye.set(eye.parameter_names[i], values[i]);
    current = values;
    return functional(eye);
  };
}

Propagated UncertainEye::propagate(const Functional& functional) const {
  const MatrixXd j = jacobian(parameters(), of_parameters(functional));
  Propagated result{functional(eye_), j * eye_.covariance * j.transpose(), {}, VectorXd(j.rows())};
  for (Index row = 0; row < j.rows(); ++row) {
    result.origin.push_back(origin_of(j.row(row)));
    result.prior_sigma[row] = prior_sigma_of(j.row(row));
  }
  return result;
}

const MatrixXd& UncertainEye::covariance_by_images() const {
  return steps_.empty() ? eye_.covariance : steps_.front().covariance_before;
}

double UncertainEye::prior_sigma_of(const Eigen::RowVectorXd& row) const {
  const MatrixXd& by_images = covariance_by_images();
  const double total = row.dot(by_images * row.transpose());
  double variance = 0;
  for (Index i = 0; i < row.size(); ++i) {
    const auto known = eye_.prior_sigma.find(eye_.parameter_names[i]);
    if (known != eye_.prior_sigma.end())
      variance += std::pow(row[i] * known->second, 2);
    else if (source(i) == "prior")
      variance += row[i] * row[i] * by_images(i, i);
    else if (row[i] * row[i] * by_images(i, i) > 1e-6 * total)
      return std::numeric_limits<double>::infinity();
  }
  return std::sqrt(variance);
}

Origin UncertainEye::origin_of(const Eigen::RowVectorXd& row) const {
  const MatrixXd& by_images = covariance_by_images();
  const auto variance = [&](const MatrixXd& covariance) { return row.dot(covariance * row.transpose()); };
  std::map<std::string, double> parts;  // of the variance, by source
  for (Index i = 0; i < row.size(); ++i) parts[source(i)] += row[i] * row[i] * by_images(i, i);
  Origin origin = std::max_element(parts.begin(), parts.end(), [](const auto& a, const auto& b) {
                    return a.second < b.second;
                  })->first;
  // Of what an instrument has narrowed, before or here, the images' share is not told.
  constexpr double noticeable = 0.01;
  double by_instruments = 0, total = 0;
  for (const auto& [name, part] : parts) {
    total += part;
    if (!is_of_images(name)) by_instruments += part;
  }
  const bool is_narrowed = by_instruments > noticeable * total ||
                           variance(eye_.covariance) < (1 - noticeable) * variance(by_images);
  if (!is_narrowed) {
    const bool by_hand = std::any_of(parts.begin(), parts.end(), [](const auto& part) {
      return part.first.rfind("labels", 0) == 0 && part.second > 0;
    });
    const double prior_sigma = prior_sigma_of(row);
    const double left = prior_sigma > 0 ? variance(by_images) / (prior_sigma * prior_sigma) : 1;
    origin = Origin::of_images(by_hand ? "labels" : "mri", std::clamp(1 - left, 0.0, 1.0));
  }
  for (std::size_t s = 0; s < steps_.size(); ++s) {
    const MatrixXd& after = s + 1 < steps_.size() ? steps_[s + 1].covariance_before : eye_.covariance;
    if (variance(after) < variance(steps_[s].covariance_before) / 2) origin.source = steps_[s].source;
  }
  return origin;
}

double UncertainEye::learn(const std::string& source, const VectorFunction& function,
                           const VectorXd& measured, const MatrixXd& noise_covariance) {
  NormalDistribution doubted = parameters();
  for (Index i = 0; i < doubted.mean.size(); ++i) {
    if (this->source(i) != "prior") continue;
    doubted.covariance.row(i) *= tail_of(eye_.parameter_names[i]);
    doubted.covariance.col(i) *= tail_of(eye_.parameter_names[i]);
  }
  const double innovation_sigma = condition(doubted, function, measured, noise_covariance);
  NormalDistribution learnt = parameters();
  steps_.push_back({source, learnt.covariance});
  condition(learnt, function, measured, noise_covariance);
  for (Index i = 0; i < learnt.mean.size(); ++i) eye_.set(eye_.parameter_names[i], learnt.mean[i]);
  eye_.covariance = std::move(learnt.covariance);
  return innovation_sigma;
}

double UncertainEye::learn(const ExternalMeasurement& measurement) {
  return learn(measurement.source, of_parameters(measurement.of_eye), measurement.value,
               measurement.covariance);
}

std::vector<std::string> UncertainEye::learnt_from() const {
  std::vector<std::string> sources;
  for (const Step& step : steps_) sources.push_back(step.source);
  return sources;
}

std::string others_of(bool is_of_images) {
  return is_of_images ? "the images" : "the images with the readings before it";
}

std::string judge_innovation(const Surprise& surprise) {
  const std::string text =
      fmt::format("{} and {} differ by {:.1f} standard deviations{}", surprise.reading,
                  others_of(surprise.is_of_images), surprise.innovation_sigma, surprise.values);
  if (surprise.innovation_sigma > irreconcilable_innovation_sigma)
    throw input_error(text + ": they cannot both be of this eye",
                      surprise.is_of_images
                          ? "check eye, sign, unit and digits of the measurement; without it the "
                            "images speak alone"
                          : "check eye, sign, unit and digits of each reading; leave out the one "
                            "that is not this eye's");
  return surprise.innovation_sigma > doubtful_innovation_sigma ? text : "";
}

}  // namespace emmetrope
