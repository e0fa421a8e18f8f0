#pragma once
#include <Eigen/Core>

namespace emmetrope::segmentation {

/// Prior of the free form of a cornea that is no biconic (pipeline/eye/parametric/corneal_form.hpp): a
/// Gaussian bump or dent somewhere about the apex, in no preferred direction, and whatever else there may be,
/// term by term. Covariance of the terms (um^2) about 0. What a bump has in a tilt and in a biconic's terms
/// is left to those.
Eigen::MatrixXd corneal_form_covariance_um2();

}  // namespace emmetrope::segmentation
