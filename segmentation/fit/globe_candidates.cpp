#include "segmentation/fit/globe_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/fit_passes.hpp"

namespace emmetrope::segmentation {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

std::array<double, 4> place_of(const Sample& sample) {
  const Eigen::Vector3d& x = sample.position;
  return {static_cast<double>(sample.stack), x.x(), x.y(), x.z()};
}

/// Minus the logarithms of the densities of a voxel, less that of a normal distribution's middle.
class VoxelCost {
 public:
  VoxelCost(const StackSampling& stack, double misfit)
      : misfit_(misfit),
        unexplained_(std::max(1.0, std::log(stack.fat / (stack.noise * misfit * std::sqrt(2 * pi))))) {}
  double operator()(const std::optional<double>& residual) const {
    if (!residual) return unexplained_;
    constexpr double c2 = 9;
    const double r = *residual / misfit_;
    return c2 * std::log1p(r * r / c2) / 2;
  }

 private:
  double misfit_, unexplained_;
};

}  // namespace

void note_residuals(Candidate& candidate, FitProblem problem, const std::vector<ObservedStack>& stacks) {
  const ForwardModel& model = *problem.model;
  const VectorXd& parameters = candidate.solution.parameters;
  candidate.misfit = freeze_deviations(problem, parameters);
  const ForwardModel::AtParameters at(model, parameters);
  for (const Sample& sample : problem.samples)
    candidate.residuals[place_of(sample)] =
        residual(problem, at, sample) * sample.deviation / model.stacks()[sample.stack].noise;
  Selection about;
  about.outside_mm = 3;
  for (const Sample& sample : select_samples(model, parameters, stacks, about))
    candidate.residuals.emplace(place_of(sample), std::nullopt);
  problem.samples.clear();
  candidate.prior_cost = evaluate(problem, parameters, false).cost;
}

void keep_distinct(std::vector<Candidate>& candidates, const ParameterLayout& layout) {
  constexpr std::size_t most = 3;
  // Chosen: with displaced fat the right globe was up to 0.6 % above the lowest (once 22 %); in a real scan a
  // wrong one 7 % above.
  constexpr double alike_mm = 0.15, nearly = 1.03;
  const auto alike = [&](const VectorXd& a, const VectorXd& b) {
    const int fat = layout.stack(0) + fat_shift_first;
    return (a - b).segment<3>(globe_x).cwiseAbs().maxCoeff() < alike_mm &&
           (a - b).segment<2>(fat).cwiseAbs().maxCoeff() < alike_mm;
  };
  std::sort(candidates.begin(), candidates.end(),
            [](const auto& x, const auto& y) { return x.solution.cost < y.solution.cost; });
  const double lowest = candidates.front().solution.cost;
  std::vector<Candidate> kept;
  for (Candidate& candidate : candidates)
    if (kept.size() < most && candidate.solution.cost <= nearly * lowest &&
        std::none_of(kept.begin(), kept.end(), [&](const Candidate& other) {
          return alike(candidate.solution.parameters, other.solution.parameters);
        }))
      kept.push_back(std::move(candidate));
  candidates = std::move(kept);
}

const Candidate& most_likely(const std::vector<Candidate>& candidates, const ForwardModel& model) {
  if (candidates.size() == 1) return candidates.front();
  // Chosen: of real heads right ones were up to 3.1 % above the lowest, wrong ones 6 % and more.
  constexpr double alike = 1.04;
  VectorXd misfit = candidates.front().misfit;
  for (const Candidate& candidate : candidates) misfit = misfit.cwiseMin(candidate.misfit);
  std::vector<VoxelCost> cost_in;
  for (std::size_t s = 0; s < model.stacks().size(); ++s)
    cost_in.emplace_back(model.stacks()[s], misfit[static_cast<Eigen::Index>(s)]);

  struct Cost {
    double known, explained;  ///< of the voxels that all know of, and of those that all explain
  };
  std::vector<Cost> costs;
  for (const Candidate& candidate : candidates) costs.push_back({candidate.prior_cost, candidate.prior_cost});
  for (const auto& [place, of_first] : candidates.front().residuals) {
    std::vector<double> of_voxel;
    bool all_explain = true;
    for (const Candidate& candidate : candidates)
      if (const auto found = candidate.residuals.find(place); found != candidate.residuals.end()) {
        all_explain = all_explain && found->second;
        of_voxel.push_back(cost_in[static_cast<std::size_t>(place[0])](found->second));
      }
    if (of_voxel.size() < candidates.size()) continue;
    for (std::size_t i = 0; i < costs.size(); ++i) {
      costs[i].known += of_voxel[i];
      if (all_explain) costs[i].explained += of_voxel[i];
    }
  }
  double lowest = std::numeric_limits<double>::infinity();
  for (const Cost& cost : costs) lowest = std::min(lowest, cost.known);
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < costs.size(); ++i)
    if (costs[i].known <= alike * lowest && (!best || costs[i].explained < costs[*best].explained)) best = i;
  return candidates[best.value_or(0)];
}

}  // namespace emmetrope::segmentation
