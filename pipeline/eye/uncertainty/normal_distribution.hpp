#pragma once
#include <Eigen/Core>
#include <functional>

namespace emmetrope {

/// Numbers that follow from others.
using VectorFunction = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;

/// Numbers that are known jointly up to a normal distribution.
struct NormalDistribution {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;  ///< positive semi-definite; a number without variance is known exactly
};

/// d function / d number at the mean, one column a number: central differences over 0.2 standard deviations,
/// wide enough for what an interval averages over, narrow enough for the derivative. Zero where a number is
/// known exactly.
Eigen::MatrixXd jacobian(const NormalDistribution& numbers, const VectorFunction& function);

/// Learns that `function` of the numbers was measured: an iterated extended Kalman filter (Bell and Cathey
/// 1993), the covariance in Joseph's form, which stays positive.
///
/// \return how far the measurement was from what was expected: the number of standard deviations that a
///   single normal number exceeds as rarely as chi2 of this dimension is exceeded; above 3 (once in 370) the
///   two hardly fit together, whatever the dimension
double condition(NormalDistribution& numbers, const VectorFunction& function, const Eigen::VectorXd& measured,
                 const Eigen::MatrixXd& noise_covariance);

}  // namespace emmetrope
