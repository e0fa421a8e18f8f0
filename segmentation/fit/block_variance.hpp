#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/fit/least_squares.hpp"

/// How uncertain a least-squares fit is where its residuals are coherent over blocks of samples, which noise
/// is not: judged by what a block does to the fit.
namespace emmetrope::segmentation {

/// The block of each sample, counted from 0.
using Blocks = std::vector<int>;

/// Blocks of the samples that are in the same block of both.
Blocks intersection(const Blocks& first, const Blocks& second);

/// A figure's variance from what blocks do to it, in two ways.
struct BlockVariance {
  Eigen::VectorXd unbiased, jackknife;
};

/// Linearised at the solution, the residuals of block b move a figure f'x by u_b = f'C J_b'r_b, and leaving
/// the block out moves it by d_b = f'(H - J_b'J_b)^-1 J_b'r_b (but for the sign).
///   unbiased: the sum of u_b d_b. Right in the mean for errors of independent samples, whatever a block's
///     share in the fit, and parameters that scatter as the priors say: residuals' covariance is then
///     I - J_b C J_b' (of single samples: HC2, MacKinnon and White 1985). Errors that are alike within a
///     block it finds, and states too small where shares are large, since the fit has followed them.
///   jackknife: (B - 1)/B times the sum of d_b^2 over B blocks (Efron and Stein 1981). Right for errors that
///     are alike within a block and independent between blocks where shares are small, and else, but for that
///     factor, too large, of independent samples as well (MacKinnon, Nielsen and Webb 2023).
/// Priors are no samples: their share of the variance is in neither.
/// \param covariance  C = H^-1 of the parameters, priors included
/// \param figures  a column f for each figure
BlockVariance block_variance(const LinearRows& rows, const Eigen::MatrixXd& covariance, const Blocks& blocks,
                             const Eigen::MatrixXd& figures);

/// The covariance C with the figures' variances widened for errors that are coherent in two ways at once, as
/// within a slice and within a patch of the wall. Of each figure (Cameron, Gelbach and Miller 2011)
///   v = prior's share + V(first) + V(second) - V(intersection),
/// V being block_variance. A figure's own v rests on few blocks and scatters, so that all are widened by the
/// mean of v / f'Cf (as Rao and Scott 1981 do), w, which is at least 1: the unbiased one, and the more of the
/// jackknife's the farther that is above 1, all of it from 1.5 on, where residuals are coherent for sure.
/// What is added is an error of the figures alone, by the shortest way that the parameters have to it,
///   C + (w - 1) P F'CF P', P = F (F'F)^-1,
/// so that combinations without effect on the figures stay as certain as they were.
/// \param figures  of parameters in one unit
Eigen::MatrixXd widened_for_blocks(const LinearRows& rows, const Eigen::MatrixXd& covariance,
                                   const Blocks& first, const Blocks& second, const Eigen::MatrixXd& figures);

}  // namespace emmetrope::segmentation
