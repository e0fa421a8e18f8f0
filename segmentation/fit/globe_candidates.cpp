#include "segmentation/fit/globe_candidates.hpp"

#include <algorithm>
#include <cmath>

namespace emmetrope::segmentation {

using Eigen::Vector3d;
using Eigen::VectorXd;

VoxelLoss voxel_loss(const FitProblem& problem, const VectorXd& parameters) {
  const ForwardModel::AtParameters at(*problem.model, parameters);
  VoxelLoss loss;
  for (const Sample& sample : problem.samples) {
    const double noise = problem.model->stacks()[sample.stack].noise;
    const double r = residual(problem, at, sample) * sample.deviation / noise;
    const Vector3d& x = sample.position;
    loss[{static_cast<double>(sample.stack), x.x(), x.y(), x.z()}] =
        std::log1p(r * r / (problem.loss_scale * problem.loss_scale));
  }
  return loss;
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

const Candidate& most_likely(const std::vector<Candidate>& candidates) {
  std::vector<double> sums(candidates.size(), 0);
  for (const auto& entry : candidates.front().loss) {
    std::vector<double> losses;
    for (const Candidate& candidate : candidates)
      if (const auto found = candidate.loss.find(entry.first); found != candidate.loss.end())
        losses.push_back(found->second);
    if (losses.size() < candidates.size()) continue;
    for (std::size_t i = 0; i < losses.size(); ++i) sums[i] += losses[i];
  }
  return candidates[static_cast<std::size_t>(std::min_element(sums.begin(), sums.end()) - sums.begin())];
}

}  // namespace emmetrope::segmentation
