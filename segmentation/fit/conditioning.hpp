#pragma once
#include <Eigen/Core>

#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// Puts what else is known of some numbers of an eye into its fit; every free parameter follows by its regression on them.
/// Exact for normal distributions.
/// \param jacobian    the numbers' derivatives (rows) by the free parameters
/// \param step        by how much the numbers change
/// \param covariance  of the numbers, with what else is known
void condition(EyeFit& fit, const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& step,
               const Eigen::MatrixXd& covariance);

}  // namespace emmetrope::segmentation
