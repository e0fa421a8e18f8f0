#include "correction/prescription/uncertainty.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pipeline/base/astigmatism.hpp"

namespace emmetrope::correction {
namespace {

struct Group {
  const char* source;
  std::vector<std::string> prefixes;  ///< of its parameters' names
};
const std::vector<Group>& groups() {
  static const std::vector<Group> all{
      {"axial length", {"axial_length"}},
      {"anterior cornea", {"cornea_c_", "cornea_j", "cornea_q", "cornea_zernike_"}},
      {"posterior cornea", {"cornea_back", "cornea_thickness"}},
      {"anterior chamber depth", {"anterior_chamber_depth"}},
      {"lens shape", {"lens_thickness", "lens_anterior", "lens_posterior"}},
      {"lens tilt and decentre", {"lens_tilt", "lens_decentre"}},
      {"lens index", {"lens_index"}}};
  return all;
}
bool belongs(const Group& group, const std::string& parameter) {
  return std::any_of(group.prefixes.begin(), group.prefixes.end(),
                     [&](const std::string& prefix) { return parameter.rfind(prefix, 0) == 0; });
}

double signed_root(double variance) { return std::copysign(std::sqrt(std::abs(variance)), variance); }

}  // namespace

Eigen::MatrixXd refraction_sensitivity(const UncertainOptics& optics, const RefractionOf& refraction) {
  const NormalDistribution numbers = optics.known.parameters();
  Eigen::MatrixXd sensitivity(3, numbers.mean.size());
  for (Eigen::Index i = 0; i < numbers.mean.size(); ++i) {
    const double sigma = std::sqrt(std::max(0.0, numbers.covariance(i, i)));
    const double step = sigma > 0 ? sigma / 2 : 1e-4 * std::max(1.0, std::abs(numbers.mean[i]));
    Eigen::VectorXd ahead = numbers.mean, behind = numbers.mean;
    ahead[i] += step;
    behind[i] -= step;
    sensitivity.col(i) =
        (as_vector(refraction(eye_at(optics, ahead))) - as_vector(refraction(eye_at(optics, behind)))) /
        (2 * step);
  }
  return sensitivity;
}

std::vector<BudgetLine> uncertainty_budget(const UncertainOptics& optics,
                                           const Eigen::MatrixXd& sensitivity) {
  std::vector<BudgetLine> budget;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Group& group : groups()) {
    Eigen::MatrixXd part = Eigen::MatrixXd::Zero(3, sensitivity.cols());
    for (Eigen::Index i = 0; i < sensitivity.cols(); ++i)
      if (belongs(group, optics.known.eye().parameter_names[i])) part.col(i) = sensitivity.col(i);
    const Eigen::Vector3d variance =
        (part * optics.known.eye().covariance * part.transpose()).diagonal().cwiseMax(0);
    sum += variance;
    budget.push_back({group.source, std::sqrt(variance[0]), std::sqrt(variance[1]), std::sqrt(variance[2])});
  }
  const Eigen::Vector3d total =
      (sensitivity * optics.known.eye().covariance * sensitivity.transpose()).diagonal().cwiseMax(0);
  const Eigen::Vector3d cross = total - sum;
  budget.push_back({"correlations", signed_root(cross[0]), signed_root(cross[1]), signed_root(cross[2])});
  budget.push_back({"total", std::sqrt(total[0]), std::sqrt(total[1]), std::sqrt(total[2])});
  return budget;
}

namespace {
/// How an instrument's reading depends on the eye.
PlannedObservation of_instrument(const UncertainOptics& optics, const ExternalMeasurement& measurement) {
  const auto reading = [&](const Eigen::VectorXd& values) {
    return measurement.of_eye(optics.known.at(values));
  };
  return {measurement.source, jacobian(optics.known.parameters(), reading), measurement.covariance};
}
}  // namespace

// Only the accuracy of these readings matters, not what they say.
PlannedObservation keratometry(const UncertainOptics& optics, double sigma_D) {
  return of_instrument(optics, keratometry_measurement("43@180/44@90", sigma_D));
}

PlannedObservation optical_axial_length(const UncertainOptics& optics, double sigma_mm) {
  return of_instrument(optics, axial_length_measurement("24", sigma_mm, 0));
}

PlannedObservation known_refraction(const Eigen::MatrixXd& refraction_sensitivity, double sigma_D) {
  return {"refraction", refraction_sensitivity, Eigen::Matrix3d::Identity() * sigma_D * sigma_D};
}

Eigen::MatrixXd covariance_after(const Eigen::MatrixXd& covariance, const PlannedObservation& measurement) {
  const Eigen::MatrixXd& h = measurement.sensitivity;
  const Eigen::MatrixXd innovation = h * covariance * h.transpose() + measurement.noise_covariance;
  const Eigen::MatrixXd gain = innovation.ldlt().solve(h * covariance).transpose();
  // Joseph's form stays positive semi-definite.
  const Eigen::MatrixXd keep = Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()) - gain * h;
  return keep * covariance * keep.transpose() + gain * measurement.noise_covariance * gain.transpose();
}

Origin with_refraction(Origin origin, double variance_before, double variance_after) {
  constexpr double noticeable_share = 0.1;
  if (origin.source != "refraction" && variance_after < (1 - noticeable_share) * variance_before)
    origin.source += "+refraction";
  return origin;
}

RefractionIntervals refraction_intervals(const PowerVector& refraction, const Eigen::Matrix3d& covariance,
                                         const std::array<Origin, 3>& origins) {
  const auto interval = [&](double value, int i) {
    return Measured::from_sigma(value, std::sqrt(std::max(0.0, covariance(i, i))), origins[i]);
  };
  const SpheroCylinder notation = to_sphero_cylinder(refraction);
  const Astigmatism astigmatism = astigmatism_of({refraction.J0_D, refraction.J45_D}, covariance);
  const Origin& of_cylinder =
      std::abs(refraction.J0_D) >= std::abs(refraction.J45_D) ? origins[1] : origins[2];
  const double sigma_half_D = astigmatism.sigma_half_cylinder_D;
  RefractionIntervals intervals;
  intervals.M_D = interval(refraction.M_D, 0);
  intervals.J0_D = interval(refraction.J0_D, 1);
  intervals.J45_D = interval(refraction.J45_D, 2);
  // Sphere is M + |J|, the minus cylinder -2 |J|.
  const double var_sphere =
      covariance(0, 0) + sigma_half_D * sigma_half_D + 2 * astigmatism.covariance_with_M_D2;
  intervals.sphere_D =
      Measured::from_sigma(notation.sphere_D, std::sqrt(std::max(0.0, var_sphere)), origins[0]);
  intervals.cylinder_D = Measured::from_sigma(notation.cylinder_D, 2 * sigma_half_D, of_cylinder);
  intervals.cylinder_D.ci95[1] = std::min(0.0, intervals.cylinder_D.ci95[1]);
  intervals.axis_deg = {notation.axis_deg,
                        {notation.axis_deg - astigmatism.axis_half_width_deg,
                         notation.axis_deg + astigmatism.axis_half_width_deg},
                        of_cylinder.source,
                        {},
                        of_cylinder.image_share};
  return intervals;
}

}  // namespace emmetrope::correction
