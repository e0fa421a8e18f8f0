#pragma once
#include <Eigen/Core>
#include <array>

#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Puts what else is known of some numbers of an eye into its fit; every free parameter follows by its regression on them.
/// Exact for normal distributions.
/// \param jacobian    the numbers' derivatives (rows) by the free parameters
/// \param step        by how much the numbers change
/// \param covariance  of the numbers, with what else is known
void condition(EyeFit& fit, const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& step,
               const Eigen::MatrixXd& covariance);

/// While it lives the covariances of two fits are without an error that both have alike: their difference has none of that,
/// and neither tells the other anything of it. Where one of them has none that is known, both stay as they are.
class WithoutSharedError {
 public:
  /// \param error  EyeFit::shared_covariance or EyeFit::common_covariance
  WithoutSharedError(EyeFit& a, EyeFit& b, Eigen::MatrixXd EyeFit::*error);
  ~WithoutSharedError();
  WithoutSharedError(const WithoutSharedError&) = delete;
  WithoutSharedError& operator=(const WithoutSharedError&) = delete;

 private:
  std::array<EyeFit*, 2> fits_;
  std::array<Eigen::MatrixXd, 2> taken_;
};

}  // namespace emmetrope::segmentation
