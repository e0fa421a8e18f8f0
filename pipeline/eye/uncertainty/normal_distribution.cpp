#include "pipeline/eye/uncertainty/normal_distribution.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>

namespace emmetrope {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

double as_normal_sigmas(double chi2, Index dimension) {
  using boost::math::complement;
  const double rarity =
      std::max(boost::math::cdf(complement(boost::math::chi_squared(static_cast<double>(dimension)), chi2)),
               std::numeric_limits<double>::min());  // 37 standard deviations and more
  return boost::math::quantile(complement(boost::math::normal(), rarity / 2));
}

}  // namespace

MatrixXd jacobian(const NormalDistribution& numbers, const VectorFunction& function) {
  MatrixXd jacobian = MatrixXd::Zero(function(numbers.mean).size(), numbers.mean.size());
  VectorXd at = numbers.mean;
  for (Index i = 0; i < at.size(); ++i) {
    const double step = 0.2 * std::sqrt(std::max(0.0, numbers.covariance(i, i)));
    if (step == 0) continue;
    at[i] = numbers.mean[i] + step;
    const VectorXd above = function(at);
    at[i] = numbers.mean[i] - step;
    jacobian.col(i) = (above - function(at)) / (2 * step);
    at[i] = numbers.mean[i];
  }
  return jacobian;
}

double condition(NormalDistribution& numbers, const VectorFunction& function, const VectorXd& measured,
                 const MatrixXd& noise_covariance) {
  const VectorXd prior = numbers.mean;
  const MatrixXd p = numbers.covariance;
  const auto innovation_covariance = [&](const MatrixXd& j) -> MatrixXd {
    return j * p * j.transpose() + noise_covariance;
  };
  const VectorXd innovation = measured - function(prior);
  const double chi2 =
      innovation.dot(innovation_covariance(jacobian(numbers, function)).ldlt().solve(innovation));

  MatrixXd j, gain;
  for (int iteration = 0; iteration < 4; ++iteration) {
    j = jacobian(numbers, function);
    gain = innovation_covariance(j).ldlt().solve(j * p).transpose();
    numbers.mean = prior + gain * (measured - function(numbers.mean) - j * (prior - numbers.mean));
  }
  const MatrixXd keep = MatrixXd::Identity(p.rows(), p.cols()) - gain * j;
  numbers.covariance = keep * p * keep.transpose() + gain * noise_covariance * gain.transpose();
  return as_normal_sigmas(chi2, measured.size());
}

}  // namespace emmetrope
