#include "segmentation/fit/conditioning.hpp"

#include <Eigen/LU>

namespace emmetrope::segmentation {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void condition(EyeFit& fit, const MatrixXd& jacobian, const VectorXd& step, const MatrixXd& covariance) {
  const MatrixXd own = jacobian * fit.covariance * jacobian.transpose(),
                 slope = fit.covariance * jacobian.transpose() * own.inverse();
  const VectorXd move = slope * step;
  for (std::size_t i = 0; i < fit.active.size(); ++i)
    fit.parameters[fit.active[i]] += move[static_cast<Eigen::Index>(i)];
  fit.covariance += slope * (covariance - own) * slope.transpose();
}

WithoutSharedError::WithoutSharedError(EyeFit& a, EyeFit& b, MatrixXd EyeFit::*error) : fits_{&a, &b} {
  if ((a.*error).size() == 0 || (b.*error).size() == 0) return;
  for (std::size_t i = 0; i < 2; ++i) {
    taken_[i] = fits_[i]->*error;
    fits_[i]->covariance -= taken_[i];
  }
}

WithoutSharedError::~WithoutSharedError() {
  for (std::size_t i = 0; i < 2; ++i)
    if (taken_[i].size() > 0) fits_[i]->covariance += taken_[i];
}

}  // namespace emmetrope::segmentation
