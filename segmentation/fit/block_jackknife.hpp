#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/fit/least_squares.hpp"

/// How uncertain a least-squares fit is where its residuals are coherent over blocks of samples, which noise
/// is not: judged by what leaving a block out does to the fit.
namespace emmetrope::segmentation {

/// The block of each sample, counted from 0.
using Blocks = std::vector<int>;

/// Blocks of the samples that are in the same block of both.
Blocks intersection(const Blocks& first, const Blocks& second);

/// Delete-a-block jackknife, linearised at the solution: leaving block b out moves the parameters by
///   d_b = -(H - J_b'J_b)^-1 J_b'r_b,
/// and a figure f'x by f'd_b. Its variance is (B - 1)/B times the sum of their squares over the B blocks
/// (Efron and Stein 1981): right for errors that are alike within a block and independent between blocks,
/// whatever their size, and too large rather than too small where blocks are few (MacKinnon, Nielsen and Webb
/// 2023). Priors are no samples: their share of the variance is not in it.
/// \param covariance  H^-1 of the parameters, priors included
/// \param figures     a column f for each figure
Eigen::VectorXd jackknife_variance(const LinearRows& rows, const Eigen::MatrixXd& covariance,
                                   const Blocks& blocks, const Eigen::MatrixXd& figures);

/// The covariance C with the figures' variances widened for errors that are coherent in two ways at once, as
/// within a slice and within a patch of the wall. Of each figure (Cameron, Gelbach and Miller 2011)
///   v = prior's share + V(first) + V(second) - V(intersection),
/// V being the jackknife's. A figure's own v rests on few blocks and scatters, so that all are widened by the
/// mean of v / f'Cf (as Rao and Scott 1981 do), w, which is at least 1. What is added is an error of the
/// figures alone, by the shortest way that the parameters have to it,
///   C + (w - 1) P F'CF P', P = F (F'F)^-1,
/// so that combinations without effect on the figures stay as certain as they were.
/// \param figures  of parameters in one unit
Eigen::MatrixXd widened_for_blocks(const LinearRows& rows, const Eigen::MatrixXd& covariance,
                                   const Blocks& first, const Blocks& second, const Eigen::MatrixXd& figures);

}  // namespace emmetrope::segmentation
