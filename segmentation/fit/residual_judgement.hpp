#pragma once
#include <array>

#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// How many voxels in a row make one independent residual, as of a first-order process, from the correlation
/// r of neighbours, shrunk by 1 - 1/(pairs r^2), at least 0: that of independent residuals has a variance of
/// 1/pairs by chance.
/// \param pairs  of neighbours that the correlation was taken from
double voxels_per_independent(double correlation, double pairs);

/// Residuals by part, into the fit.
/// \return by how much the variance of each part's samples is to be widened: what the model does not explain,
///   and neighbours whose residuals are alike, carry less information than independent noise.
std::array<double, part_count> judge_residuals(EyeFit& fit, const FitProblem& problem);

/// The fit's covariance with the variances of the eye's distances (eye_distances.hpp) widened where residuals
/// are coherent over a slice, as where head or eye moved between slices, or over a patch of the eye 30
/// degrees wide across slices, as beside a muscle (block_variance.hpp): both are farther than neighbouring
/// voxels tell. Powers and radii, of which a few blocks at the front tell all, stay as they are.
/// \pre fit.parameters solve the problem, and fit.covariance is theirs
Eigen::MatrixXd widened_for_coherent_residuals(const EyeFit& fit, const FitProblem& problem);

/// The fit's covariance with the variances of the globe's length, width and height widened by what the model
/// of the wall and of displaced fat over it may be wrong in T1, where fat is much brighter than the wall, and
/// the wall hardly brighter than the vitreous.
Eigen::MatrixXd widened_for_faint_wall(const EyeFit& fit);

}  // namespace emmetrope::segmentation
