#include "correction/uncertainty.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>

namespace emmetrope::correction {
namespace {

struct Group {
  const char* source;
  std::vector<std::string> parameters;
};
const std::vector<Group>& groups() {
  static const std::vector<Group> all{
      {"axial length", {"optical_axial_length_mm"}},
      {"anterior cornea", {"cornea_c_per_mm", "cornea_j0_per_mm", "cornea_j45_per_mm", "cornea_q"}},
      {"posterior cornea", {"cornea_back_ratio", "cornea_thickness_mm"}},
      {"anterior chamber depth", {"anterior_chamber_depth_mm"}},
      {"lens shape",
       {"lens_thickness_mm", "lens_anterior_radius_mm", "lens_posterior_radius_mm", "lens_anterior_q",
        "lens_posterior_q"}},
      {"lens tilt and decentre",
       {"lens_tilt_x_deg", "lens_tilt_y_deg", "lens_decentre_x_mm", "lens_decentre_y_mm"}},
      {"lens index", {"lens_index"}}};
  return all;
}

double signed_root(double variance) { return std::copysign(std::sqrt(std::abs(variance)), variance); }

Eigen::Vector3d as_vector(const PowerVector& power) { return {power.M_D, power.J0_D, power.J45_D}; }

/// Value and quantiles of draws, in the order given.
Measured from_draws(double value, std::vector<double>& draws, const std::string& source) {
  const auto quantile = [&](double fraction) {
    const auto at =
        draws.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(draws.size() - 1));
    std::nth_element(draws.begin(), at, draws.end());
    return *at;
  };
  const double low = quantile(0.025), high = quantile(0.975);
  return {value, {std::min(low, value), std::max(high, value)}, source};
}

}  // namespace

Eigen::MatrixXd refraction_sensitivity(const UncertainEye& eye, const RefractionOf& refraction) {
  Eigen::MatrixXd sensitivity(3, eye.values.size());
  for (Eigen::Index i = 0; i < eye.values.size(); ++i) {
    const double sigma = std::sqrt(std::max(0.0, eye.covariance(i, i)));
    const double step = sigma > 0 ? sigma / 2 : 1e-4 * std::max(1.0, std::abs(eye.values[i]));
    Eigen::VectorXd ahead = eye.values, behind = eye.values;
    ahead[i] += step;
    behind[i] -= step;
    sensitivity.col(i) =
        (as_vector(refraction(eye_at(eye, ahead))) - as_vector(refraction(eye_at(eye, behind)))) / (2 * step);
  }
  return sensitivity;
}

std::vector<BudgetLine> uncertainty_budget(const UncertainEye& eye, const Eigen::MatrixXd& sensitivity) {
  std::vector<BudgetLine> budget;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Group& group : groups()) {
    Eigen::MatrixXd part = Eigen::MatrixXd::Zero(3, sensitivity.cols());
    for (Eigen::Index i = 0; i < sensitivity.cols(); ++i)
      if (std::find(group.parameters.begin(), group.parameters.end(), eye.parameters[i]) !=
          group.parameters.end())
        part.col(i) = sensitivity.col(i);
    const Eigen::Vector3d variance = (part * eye.covariance * part.transpose()).diagonal().cwiseMax(0);
    sum += variance;
    budget.push_back({group.source, std::sqrt(variance[0]), std::sqrt(variance[1]), std::sqrt(variance[2])});
  }
  const Eigen::Vector3d total =
      (sensitivity * eye.covariance * sensitivity.transpose()).diagonal().cwiseMax(0);
  const Eigen::Vector3d cross = total - sum;
  budget.push_back({"correlations", signed_root(cross[0]), signed_root(cross[1]), signed_root(cross[2])});
  budget.push_back({"total", std::sqrt(total[0]), std::sqrt(total[1]), std::sqrt(total[2])});
  return budget;
}

Measurement keratometry(const UncertainEye& eye, double sigma_D) {
  // K = 337.5 / R with R = sqrt(R0^2 - Q h^2) at h = 1.5 mm; to first order in the toricity each component of
  // the curvature passes with the same factor R0^3 / R^3.
  constexpr double keratometric = 337.5, h_mm = 1.5;
  const double c = eye.values[eye.index_of("cornea_c_per_mm")], q = eye.values[eye.index_of("cornea_q")];
  const double squeeze = std::pow(1 - q * h_mm * h_mm * c * c, -1.5);
  Measurement measurement{"keratometry", Eigen::MatrixXd::Zero(3, eye.values.size()),
                          Eigen::Vector3d::Constant(sigma_D)};
  measurement.sensitivity(0, eye.index_of("cornea_c_per_mm")) = keratometric * squeeze;
  measurement.sensitivity(0, eye.index_of("cornea_q")) = keratometric * squeeze * c * c * c * h_mm * h_mm / 2;
  measurement.sensitivity(1, eye.index_of("cornea_j0_per_mm")) = keratometric * squeeze;
  measurement.sensitivity(2, eye.index_of("cornea_j45_per_mm")) = keratometric * squeeze;
  return measurement;
}

Measurement optical_axial_length(const UncertainEye& eye, double sigma_mm) {
  Measurement measurement{"axial length", Eigen::MatrixXd::Zero(1, eye.values.size()),
                          Eigen::VectorXd::Constant(1, sigma_mm)};
  measurement.sensitivity(0, eye.index_of("optical_axial_length_mm")) = 1;
  return measurement;
}

Measurement known_refraction(const Eigen::MatrixXd& refraction_sensitivity, double sigma_D) {
  return {"refraction", refraction_sensitivity, Eigen::Vector3d::Constant(sigma_D)};
}

namespace {
Eigen::MatrixXd gain_of(const Eigen::MatrixXd& covariance, const Measurement& measurement) {
  const Eigen::MatrixXd& h = measurement.sensitivity;
  const Eigen::MatrixXd noise = measurement.sigma.array().square().matrix().asDiagonal();
  const Eigen::MatrixXd innovation = h * covariance * h.transpose() + noise;
  return innovation.ldlt().solve(h * covariance).transpose();
}
}  // namespace

Eigen::MatrixXd covariance_after(const Eigen::MatrixXd& covariance, const Measurement& measurement) {
  const Eigen::MatrixXd gain = gain_of(covariance, measurement);
  // Joseph's form stays positive semi-definite.
  const Eigen::MatrixXd keep =
      Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()) - gain * measurement.sensitivity;
  const Eigen::MatrixXd noise = measurement.sigma.array().square().matrix().asDiagonal();
  return keep * covariance * keep.transpose() + gain * noise * gain.transpose();
}

Eigen::VectorXd values_after(const UncertainEye& eye, const Measurement& measurement,
                             const Eigen::VectorXd& innovation) {
  return eye.values + gain_of(eye.covariance, measurement) * innovation;
}

RefractionIntervals refraction_intervals(const PowerVector& refraction, const Eigen::Matrix3d& covariance,
                                         const std::string& source, std::uint64_t seed) {
  const SpheroCylinder notation = to_sphero_cylinder(refraction);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
  const Eigen::Matrix3d root =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();

  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  constexpr int draws = 20000;
  std::vector<double> sphere, cylinder, axis;
  for (int i = 0; i < draws; ++i) {
    const double a = normal(random), b = normal(random), c = normal(random);
    const Eigen::Vector3d drawn = as_vector(refraction) + root * Eigen::Vector3d(a, b, c);
    const SpheroCylinder drawn_notation = to_sphero_cylinder({drawn[0], drawn[1], drawn[2]});
    sphere.push_back(drawn_notation.sphere_D);
    cylinder.push_back(drawn_notation.cylinder_D);
    axis.push_back(notation.axis_deg + std::remainder(drawn_notation.axis_deg - notation.axis_deg, 180));
  }
  const auto normal_interval = [&](double value, int i) {
    return Measured::from_sigma(value, std::sqrt(std::max(0.0, covariance(i, i))), source);
  };
  return {normal_interval(refraction.M_D, 0),
          normal_interval(refraction.J0_D, 1),
          normal_interval(refraction.J45_D, 2),
          from_draws(notation.sphere_D, sphere, source),
          from_draws(notation.cylinder_D, cylinder, source),
          from_draws(notation.axis_deg, axis, source)};
}

}  // namespace emmetrope::correction
