#pragma once
#include <array>
#include <map>
#include <vector>

#include "segmentation/fit/least_squares.hpp"

namespace emmetrope::segmentation {

/// The loss of every voxel in units of the noise, whatever the weights, by stack and place.
using VoxelLoss = std::map<std::array<double, 4>, double>;
VoxelLoss voxel_loss(const FitProblem& problem, const Eigen::VectorXd& parameters);

/// A globe that the first pass found, on its way to a whole eye.
struct Candidate {
  SolveResult solution;
  Priors priors;
  std::vector<double> apex_costs = {};
  VoxelLoss loss = {};  ///< of the whole eye
};

/// The likeliest globe and, of different ones, up to two nearly as likely: where fat may be displaced several
/// fit most of it, and the coarse model of the first pass does not decide between them.
void keep_distinct(std::vector<Candidate>& candidates, const ParameterLayout& layout);

/// Which candidate explains most of the voxels that all of them use.
const Candidate& most_likely(const std::vector<Candidate>& candidates);

}  // namespace emmetrope::segmentation
