#include "segmentation/fit/both_contrasts.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "segmentation/fit/conditioning.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The shape of an eye, as two fits have it: the parameters that are free in both, cornea to globe and the wall's
/// displacement.
class SharedShape {
 public:
  SharedShape(const EyeFit& a, const EyeFit& b, Joined joined) {
    // A free form is no biconic's.
    const bool with_cornea =
        joined == Joined::all && !a.layout.irregular_cornea && !b.layout.irregular_cornea;
    for (int i = with_cornea ? cornea_c : anterior_chamber_depth; i <= globe_z; ++i) share(a, i, b, i);
    for (int i = 0; i < std::min(a.layout.bumps, b.layout.bumps); ++i)
      share(a, a.layout.displacement() + i, b, b.layout.displacement() + i);
  }

  Index size() const { return static_cast<Index>(in_a_.size()); }
  /// What selects it among the free parameters of either.
  MatrixXd jacobian_of_a(const EyeFit& a) const { return jacobian(a, in_a_); }
  MatrixXd jacobian_of_b(const EyeFit& b) const { return jacobian(b, in_b_); }

  /// What was expected of it, and the matrix by which a difference from that is one in standard deviations.
  struct Prior {
    VectorXd mean;
    MatrixXd whitening;
    VectorXd mean_of_b;  ///< what b's fit began with, the mean unless one of them was turned
    MatrixXd of_b;       ///< and its whitened covariance, the identity unless b was turned
    MatrixXd lost_b;     ///< what of the prior's b's turn has lost: patterns of the wall that it cannot tell
  };
  Prior prior(const EyeFit& a, const EyeFit& b) const {
    Prior prior{VectorXd(size()), MatrixXd::Zero(size(), size()), VectorXd(size()), {}, {}};
    Index curvature = -1, length = -1;
    for (Index i = 0; i < size(); ++i) {
      const int parameter = a.active[in_a_[static_cast<std::size_t>(i)]];
      if (parameter == cornea_c) curvature = i;
      if (parameter == axial_length) length = i;
      prior.mean[i] = a.priors.mean[parameter];
      prior.mean_of_b[i] = b.priors.mean[b.active[in_b_[static_cast<std::size_t>(i)]]];
      prior.whitening(i, i) = 1 / a.priors.sigma[parameter];
    }
    // A longer eye has a flatter cornea.
    if (curvature >= 0 && length >= 0)
      prior.whitening(curvature, length) =
          -a.priors.curvature_per_axial_length * prior.whitening(curvature, curvature);
    prior.of_b = MatrixXd::Identity(size(), size());
    prior.lost_b = MatrixXd::Zero(size(), size());
    if (b.turned_by.size() > 0) {
      const MatrixXd in_b = jacobian_of_b(b), turn = prior.whitening * in_b * b.turned_by * in_b.transpose() *
                                                     prior.whitening.inverse();
      const Eigen::SelfAdjointEigenSolver<MatrixXd> turned(turn * turn.transpose());
      prior.lost_b = turned.eigenvectors() * (1 - turned.eigenvalues().array()).max(0).matrix().asDiagonal() *
                     turned.eigenvectors().transpose();
      prior.of_b = turn * turn.transpose() + prior.lost_b;
    }
    return prior;
  }

 private:
  void share(const EyeFit& a, int of_a, const EyeFit& b, int of_b) {
    const auto at_a = std::find(a.active.begin(), a.active.end(), of_a),
               at_b = std::find(b.active.begin(), b.active.end(), of_b);
    if (at_a == a.active.end() || at_b == b.active.end()) return;
    in_a_.push_back(static_cast<std::size_t>(at_a - a.active.begin()));
    in_b_.push_back(static_cast<std::size_t>(at_b - b.active.begin()));
  }

  static MatrixXd jacobian(const EyeFit& fit, const std::vector<std::size_t>& places) {
    MatrixXd selected =
        MatrixXd::Zero(static_cast<Index>(places.size()), static_cast<Index>(fit.active.size()));
    for (std::size_t i = 0; i < places.size(); ++i)
      selected(static_cast<Index>(i), static_cast<Index>(places[i])) = 1;
    return selected;
  }

  std::vector<std::size_t> in_a_, in_b_;  ///< places among the free parameters
};

VectorXd free_values(const EyeFit& fit) {
  VectorXd values(static_cast<Index>(fit.active.size()));
  for (std::size_t i = 0; i < fit.active.size(); ++i)
    values[static_cast<Index>(i)] = fit.value(fit.active[i]);
  return values;
}

/// Mean and covariance of a shape.
struct Shape {
  VectorXd mean;
  MatrixXd covariance;
};

Shape shape_of(const EyeFit& fit, const MatrixXd& jacobian) {
  return {jacobian * free_values(fit), jacobian * fit.covariance * jacobian.transpose()};
}

/// The joint estimate: what the images of b say, which is its fit less the prior that it began with, added to the fit of a.
Shape joint_estimate(const Shape& a, const Shape& b, const SharedShape::Prior& prior) {
  const MatrixXd& whitening = prior.whitening;
  const MatrixXd back = whitening.inverse();
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> seen(
      whitening * b.covariance * whitening.transpose() + prior.lost_b, prior.of_b);
  const MatrixXd& axes = seen.eigenvectors();
  const VectorXd of_b = axes.transpose() * (whitening * (b.mean - prior.mean)),
                 expected = axes.transpose() * (whitening * (prior.mean_of_b - prior.mean));
  VectorXd information = VectorXd::Zero(of_b.size()), information_mean = information;
  for (Index i = 0; i < of_b.size(); ++i) {
    const double share_left = seen.eigenvalues()[i];  // of the prior's variance
    if (share_left >= 1) continue;
    information[i] = 1 / share_left - 1;
    information_mean[i] = of_b[i] / share_left - expected[i];
  }
  const MatrixXd own = (whitening * a.covariance * whitening.transpose()).inverse(),
                 covariance = (own + axes * information.asDiagonal() * axes.transpose()).inverse();
  const VectorXd mean = covariance * (own * (whitening * (a.mean - prior.mean)) + axes * information_mean);
  return {prior.mean + back * mean, back * covariance * back.transpose()};
}

/// How much of a mixture's spread fits that far apart leave.
double unexplained_share(const Agreement& agreement) {
  return agreement.birge_ratio > 1 ? 1 - 1 / (agreement.birge_ratio * agreement.birge_ratio) : 0;
}

}  // namespace

Agreement agreement_of(const EyeFit& first, const EyeFit& second) {
  Agreement agreement;
  const MatrixXd of_first = distance_derivatives(first), of_second = distance_derivatives(second);
  const bool err_alike = first.common_covariance.size() > 0 && second.common_covariance.size() > 0;
  const auto variance_of = [&](const EyeFit& fit, const VectorXd& derivatives) {
    const double variance = derivatives.dot(fit.covariance * derivatives);
    return err_alike ? variance - derivatives.dot(fit.common_covariance * derivatives) : variance;
  };
  double squares = 0;
  int compared = 0;
  for (int d = 0; d < distance_count; ++d) {
    const double apart_mm =
        of_first.col(d).dot(free_values(first)) - of_second.col(d).dot(free_values(second));
    const double first_variance = variance_of(first, of_first.col(d)),
                 second_variance = variance_of(second, of_second.col(d)),
                 variance = first_variance + second_variance;
    if (first_variance <= 0 || second_variance <= 0) continue;  // not free
    const double sigmas = std::abs(apart_mm) / std::sqrt(variance);
    squares += sigmas * sigmas;
    ++compared;
    if (sigmas > agreement.sigmas)
      agreement = {static_cast<Distance>(d), apart_mm, sigmas, second_variance / variance, 0};
  }
  if (compared > 0) agreement.birge_ratio = std::sqrt(squares / compared);
  return agreement;
}

void join_contrasts(EyeFit& first, EyeFit& second, Joined joined) {
  const SharedShape shared(first, second, joined);
  const MatrixXd in_first = shared.jacobian_of_a(first), in_second = shared.jacobian_of_b(second);
  const Agreement agreement = agreement_of(first, second);
  // That both contrasts have it alike does not make it smaller: it is taken out of both, and put back after.
  const WithoutSharedError compared(first, second, &EyeFit::common_covariance);
  const Shape of_first = shape_of(first, in_first), of_second = shape_of(second, in_second);
  Shape joint = joint_estimate(of_first, of_second, shared.prior(first, second));
  for (const auto& [shape, weight] :
       {std::pair{&of_first, agreement.weight_of_first}, {&of_second, 1 - agreement.weight_of_first}}) {
    const VectorXd apart = shape->mean - joint.mean;
    joint.covariance += unexplained_share(agreement) * weight * apart * apart.transpose();
  }
  condition(first, in_first, joint.mean - of_first.mean, joint.covariance);
  condition(second, in_second, joint.mean - of_second.mean, joint.covariance);
  first.shared_covariance = second.shared_covariance = {};
}

void doubt_each_other(EyeFit& first, EyeFit& second) {
  const SharedShape shared(first, second, Joined::all);
  const MatrixXd in_first = shared.jacobian_of_a(first), in_second = shared.jacobian_of_b(second);
  const Agreement agreement = agreement_of(first, second);
  const Shape of_first = shape_of(first, in_first), of_second = shape_of(second, in_second);
  const VectorXd apart = of_first.mean - of_second.mean;
  const MatrixXd spread = unexplained_share(agreement) * apart * apart.transpose();
  condition(first, in_first, VectorXd::Zero(shared.size()),
            of_first.covariance + (1 - agreement.weight_of_first) * spread);
  condition(second, in_second, VectorXd::Zero(shared.size()),
            of_second.covariance + agreement.weight_of_first * spread);
}

}  // namespace emmetrope::segmentation
