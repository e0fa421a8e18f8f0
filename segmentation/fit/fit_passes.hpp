#pragma once
#include <vector>

#include "segmentation/fit/least_squares.hpp"
#include "segmentation/fit/observation.hpp"

/// The passes of an eye's fit, each from where the one before it ended. Every pass sets what of the problem
/// is its own (free parameters, loss, tighter priors) and leaves its priors as they were.
namespace emmetrope::segmentation {

/// Selected parameters, places and turns of them along the head's axes: how far a step goes does not hang on the header.
Basis select_along_head(const ForwardModel& model, const std::vector<int>& active);

/// Freezes each sample's deviation for a pass: the noise of a Rician magnitude at the model's signal, widened
/// for each stack by what the model does not explain (median of the residuals), so that the loss sees
/// outliers of the misfit and not of the noise alone.
/// \return the factors
Eigen::VectorXd freeze_deviations(FitProblem& problem, const Eigen::VectorXd& parameters);

/// The parameters of a whole eye that the evidence leaves open: labels have no intensities, coil, sharpness
/// or lid.
std::vector<int> free_parameters(const ForwardModel& model, Evidence evidence);

/// Globe, lens and pose, without the cornea; the apex rides with the globe.
/// \param background_varies  fat and muscle around the globe differ by more than the globe from either (T1)
SolveResult fit_globe(FitProblem& problem, const Eigen::VectorXd& start, Evidence evidence,
                      bool background_varies);

/// The front of the eye from five depths of the apex, globe and lens kept in place; from up to three further out where
/// what they find for a cornea is as bright as the fluid behind it.
/// \param costs  receives those of all, less the lowest
SolveResult fit_cornea(FitProblem& problem, const Eigen::VectorXd& start, Evidence evidence,
                       std::vector<double>& costs);

/// Everything but the iris' thickness and slope: a thick iris would fill the gap before the lens, whose front
/// would then settle on the back of the iris.
SolveResult fit_whole_eye(FitProblem& problem, const Eigen::VectorXd& start, Evidence evidence);

/// Loss and noise model of the passes that fit the whole eye.
void set_final_loss(FitProblem& problem, Evidence evidence);

}  // namespace emmetrope::segmentation
