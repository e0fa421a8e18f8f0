#include "segmentation/fit/both_eyes.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace emmetrope::segmentation {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double per_dioptre = 1 / 337.5;  ///< keratometric power to curvature, 1/mm

Eigen::Index place_of(const EyeFit& fit, int parameter) {
  return std::find(fit.active.begin(), fit.active.end(), parameter) - fit.active.begin();
}

/// One parameter's distribution becomes another; all others follow by their regression on it.
void update(EyeFit& fit, Eigen::Index place, double mean, double variance) {
  const double old_variance = fit.covariance(place, place);
  const VectorXd slope = fit.covariance.col(place) / old_variance;
  const double step = mean - fit.value(fit.active[place]);
  for (std::size_t i = 0; i < fit.active.size(); ++i)
    fit.parameters[fit.active[i]] += slope[static_cast<Eigen::Index>(i)] * step;
  fit.covariance += (variance - old_variance) * slope * slope.transpose();
}

}  // namespace

bool couple_eyes(EyeFit& od, EyeFit& os) {
  const std::array<EyeFit*, 2> eyes{&od, &os};
  std::array<Eigen::Index, 2> place{};
  Vector2d mean, variance, prior_mean, prior_variance;
  for (int e = 0; e < 2; ++e) {
    const EyeFit& eye = *eyes[e];
    place[e] = place_of(eye, cornea_c);
    mean[e] = eye.value(cornea_c);
    variance[e] = eye.covariance(place[e], place[e]);
    prior_mean[e] = eye.priors.mean[cornea_c];
    prior_variance[e] = std::pow(eye.priors.sigma[cornea_c], 2);
  }
  const double difference_variance = std::pow(corneal_power_difference_D * per_dioptre, 2);
  if (std::pow(mean[0] - mean[1], 2) > 9 * (difference_variance + variance.sum())) return false;

  // var(a - b) = var a + var b - 2 cov(a, b)
  const double shared = (prior_variance.sum() - difference_variance) / 2;
  Matrix2d together;
  together << prior_variance[0], shared, shared, prior_variance[1];
  const Matrix2d more = together.inverse() - Matrix2d(prior_variance.cwiseInverse().asDiagonal());
  const Matrix2d of_images = variance.cwiseInverse().asDiagonal();
  const Matrix2d posterior = (of_images + more).inverse();
  const Vector2d updated = posterior * (of_images * mean + more * prior_mean);
  for (int e = 0; e < 2; ++e) update(*eyes[e], place[e], updated[e], posterior(e, e));
  return true;
}

}  // namespace emmetrope::segmentation
