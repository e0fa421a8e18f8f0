#pragma once
#include <array>
#include <map>
#include <optional>
#include <vector>

#include "segmentation/fit/least_squares.hpp"
#include "segmentation/fit/observation.hpp"

namespace emmetrope::segmentation {

/// What an eye leaves of every voxel in units of the noise, by stack and place; nothing where it does not say what the
/// voxel holds: beyond its wall, among muscle and fat.
using VoxelResiduals = std::map<std::array<double, 4>, std::optional<double>>;

/// A globe that the first pass found, on its way to a whole eye.
struct Candidate {
  SolveResult solution;
  Priors priors;
  std::vector<double> apex_costs = {};
  VoxelResiduals residuals = {};  ///< of the whole eye
  Eigen::VectorXd misfit = {};    ///< of each stack, as freeze_deviations has it
  double prior_cost = 0;          ///< of the whole eye
};

/// The likeliest globe and, of different ones, up to two nearly as likely: where fat may be displaced several
/// fit most of it, and the coarse model of the first pass does not decide between them.
void keep_distinct(std::vector<Candidate>& candidates, const ParameterLayout& layout);

/// Notes what a whole eye leaves of the voxels that it explains, and which it does not within 3 mm of its wall: a globe
/// that is too small lets voxels there look like vitreous, and on its own voxels alone it cannot be told from a right one.
/// \param problem  whose solution the candidate has
void note_residuals(Candidate& candidate, FitProblem problem, const std::vector<ObservedStack>& stacks);

/// The candidate with the largest posterior density: normal residuals, their tails bounded, where it explains a voxel,
/// any brightness up to fat's alike where it does not, and its priors. On the voxels that all of them know of, with the
/// misfit of the one that leaves least; between candidates nearly alike in that, on those that all of them explain.
const Candidate& most_likely(const std::vector<Candidate>& candidates, const ForwardModel& model);

}  // namespace emmetrope::segmentation
