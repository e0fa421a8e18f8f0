#pragma once
#include "segmentation/fit/block_variance.hpp"
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// The slice of each sample.
Blocks slices_of(const EyeFit& fit, const std::vector<Sample>& samples);

/// How far the slices of a fitted eye lie from where one eye has them, as where the head moved between them.
struct DisplacedSlices {
  double rms_mm = 0;           ///< in their plane, both axes: about sqrt 2 times the motion along one
  Eigen::MatrixXd covariance;  ///< of the free parameters, that such displacements make on top
};

/// Each slice's residuals ask for a displacement: steps along the model's derivatives P_s by the eye's place.
/// The fit has taken up a part: where slices lie d_t off, independently, one step finds N_s^-1 sum_t A_st d_t
/// with N_s = P_s'P_s, A_st = N_s [s = t] - P_s'J_s C J_t'P_t, so that the mean square over the slices,
/// weighted by N, is divided by sum tr(A_st' N_s^-1 A_st) / sum tr N_s. The solution moved by -C J_s'P_s d_s,
/// corneal power and astigmatism, which few slices tell, most. Twice the mean square that noise alone makes,
/// sum tr(N_s^-1 A_ss), widens nothing. What a head moves by along a slice's normal is hardly seen in the slice and moves
/// the solution all the same: as much is taken as along each axis in its plane, but for encoded slices, which are acquired
/// at once.
///
/// \param covariance  C, of the solution
/// \pre fit.parameters solve the problem, which has samples
DisplacedSlices displaced_slices(const EyeFit& fit, const FitProblem& problem,
                                 const Eigen::MatrixXd& covariance);

}  // namespace emmetrope::segmentation
