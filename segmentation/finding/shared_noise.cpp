#include "segmentation/finding/shared_noise.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// The lens ends about 5 mm in front of the centre.
constexpr double vitreous_reach_mm = 4.5;

struct Values {
  std::vector<Vector3d> places;  ///< from the globe's centre, over the reach
  std::vector<double> of_stack;
  std::vector<std::vector<double>> of_others;
};

Values values_near(const Stack& stack, const std::vector<Sampler>& others, const Vector3d& globe) {
  Values values;
  values.of_others.resize(others.size());
  std::vector<double> at(others.size());
  for_each_voxel_near(stack, globe, vitreous_reach_mm, [&](int c, int r, int s, const Vector3d& x) {
    for (std::size_t k = 0; k < others.size(); ++k) {
      const auto value = others[k].interpolate(x);
      if (!value) return;
      at[k] = *value;
    }
    values.places.push_back((x - globe) / vitreous_reach_mm);
    values.of_stack.push_back(stack.at(c, r, s));
    for (std::size_t k = 0; k < others.size(); ++k) values.of_others[k].push_back(at[k]);
  });
  return values;
}

/// What a quadratic of place does not explain of what each stack shows, the stack's own last.
MatrixXd residuals_of(const Values& values) {
  const auto count = static_cast<Eigen::Index>(values.places.size());
  MatrixXd basis(count, 10), shown(count, static_cast<Eigen::Index>(values.of_others.size()) + 1);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Vector3d& p = values.places[static_cast<std::size_t>(i)];
    basis.row(i) << 1, p.x(), p.y(), p.z(), p.x() * p.x(), p.y() * p.y(), p.z() * p.z(), p.x() * p.y(),
        p.x() * p.z(), p.y() * p.z();
  }
  for (std::size_t k = 0; k < values.of_others.size(); ++k)
    shown.col(static_cast<Eigen::Index>(k)) = VectorXd::Map(values.of_others[k].data(), count);
  shown.rightCols<1>() = VectorXd::Map(values.of_stack.data(), count);
  return shown - basis * basis.colPivHouseholderQr().solve(shown);
}

/// Of the others those that show most of a globe; half of its voxels would tell of no copy.
std::vector<const Stack*> that_show(const Vector3d& globe, const std::vector<const Stack*>& stacks) {
  std::vector<const Stack*> showing;
  for (const Stack* stack : stacks) {
    const Sampler sampler(*stack);
    const auto is_inside = [&](const Vector3d& x) { return sampler.interpolate(x).has_value(); };
    bool all = is_inside(globe);
    for (int axis = 0; axis < 3 && all; ++axis)
      for (const double side : {-0.8, 0.8})
        all = all && is_inside(globe + side * vitreous_reach_mm * Vector3d::Unit(axis));
    if (all) showing.push_back(stack);
  }
  return showing;
}

}  // namespace

VitreousNoise compare_noise(const Stack& stack, const std::vector<const Stack*>& others,
                            const std::vector<Vector3d>& globes) {
  constexpr std::size_t fewest_voxels = 50;
  double own = 0, left = 0, sum = 0, count = 0;
  std::map<const Stack*, double> products;
  for (const Vector3d& globe : globes) {
    const std::vector<const Stack*> showing = that_show(globe, others);
    std::vector<Sampler> samplers;
    for (const Stack* other : showing) samplers.emplace_back(*other);
    const Values values = values_near(stack, samplers, globe);
    if (values.places.size() < fewest_voxels) continue;
    const MatrixXd residuals = residuals_of(values);
    const VectorXd mine = residuals.rightCols<1>();
    const MatrixXd theirs = residuals.leftCols(static_cast<Eigen::Index>(showing.size()));
    own += mine.squaredNorm();
    left += showing.empty() ? mine.squaredNorm()
                            : (mine - theirs * theirs.colPivHouseholderQr().solve(mine)).squaredNorm();
    for (std::size_t k = 0; k < showing.size(); ++k) {
      const VectorXd its = theirs.col(static_cast<Eigen::Index>(k));
      if (its.norm() > 0) products[showing[k]] += mine.dot(its) * mine.norm() / its.norm();
    }
    sum += VectorXd::Map(values.of_stack.data(), residuals.rows()).sum();
    count += static_cast<double>(residuals.rows());
  }
  VitreousNoise noise;
  if (!(own > 0 && sum > 0)) return noise;
  noise.relative = std::sqrt(own * count) / sum;
  noise.correlation = std::sqrt(std::max(0.0, 1 - left / own));
  for (std::size_t k = 0; k < others.size(); ++k)
    if (products[others[k]] > products[others[noise.nearest]]) noise.nearest = k;
  return noise;
}

std::map<std::size_t, std::size_t> find_stored_again(const std::vector<StackOfGlobes>& stacks) {
  // Acquisitions of one textured vitreous at 60 times its noise have 0.77, at 20 times 0.3; copies of real heads smoothed
  // by 0.6 voxels 0.84 to 0.99, cut along other planes 0.88 to 1 (docs/use/reading-dicom.md).
  constexpr double of_copies = 0.85;
  // Where both have less, what the edges about the vitreous leave in it is as large as the noise.
  constexpr double least_noise = 0.01;
  std::vector<double> relative_noise;
  for (const StackOfGlobes& s : stacks)
    relative_noise.push_back(compare_noise(*s.stack, {}, s.globes).relative);
  std::vector<std::size_t> kept(stacks.size());
  std::iota(kept.begin(), kept.end(), std::size_t{0});
  std::map<std::size_t, std::size_t> again;
  while (kept.size() > 1) {
    struct Copy {
      std::size_t stack, source;
      std::pair<std::size_t, double> worth;  ///< eyes, noise
    };
    std::optional<Copy> least;
    for (const std::size_t k : kept) {
      std::vector<const Stack*> others;
      std::vector<std::size_t> numbers;
      for (const std::size_t other : kept)
        if (other != k) {
          others.push_back(stacks[other].stack);
          numbers.push_back(other);
        }
      const VitreousNoise noise = compare_noise(*stacks[k].stack, others, stacks[k].globes);
      const std::size_t source = numbers[noise.nearest];
      if (!(noise.correlation > of_copies) ||
          std::max(relative_noise[k], relative_noise[source]) < least_noise)
        continue;
      const Copy copy{k, source, {stacks[k].globes.size(), relative_noise[k]}};
      if (!least || copy.worth <= least->worth) least = copy;
    }
    if (!least) break;
    again[least->stack] = least->source;
    kept.erase(std::find(kept.begin(), kept.end(), least->stack));
  }
  // What stands for a copy may have been found to be one itself.
  for (auto& [copy, source] : again)
    while (again.count(source) != 0) source = again.at(source);
  return again;
}

}  // namespace emmetrope::segmentation
