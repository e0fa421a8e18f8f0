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

}  // namespace emmetrope::segmentation
