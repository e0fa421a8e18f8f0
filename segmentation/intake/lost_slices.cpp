#include "segmentation/intake/lost_slices.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>

namespace emmetrope::segmentation {
namespace {

bool shows_something(const std::vector<float>& slice) {
  return std::any_of(slice.begin(), slice.end(), [&](float value) { return value != slice.front(); });
}

/// Mean 0 and variance 1: the same of a copy that was stored under another scale.
Eigen::ArrayXf standardised(const std::vector<float>& slice) {
  const Eigen::ArrayXd values =
      Eigen::Map<const Eigen::ArrayXf>(slice.data(), static_cast<Eigen::Index>(slice.size())).cast<double>();
  const Eigen::ArrayXd about_mean = values - values.mean();
  return (about_mean / std::sqrt(about_mean.square().mean())).cast<float>();
}

bool are_copies(const Eigen::ArrayXf& one, const Eigen::ArrayXf& other) {
  // Rounding to 12 bits leaves less of two copies; of two acquired slices noise alone leaves its square over the contrast's,
  // above that up to a signal over noise of 1000.
  constexpr double most_difference = 1e-6;
  return (one - other).cast<double>().square().mean() < 2 * most_difference;
}

}  // namespace

std::vector<int> find_lost_slices(const Stack& stack) {
  const auto& slices = stack.slice_intensity;
  const auto first = std::find_if(slices.begin(), slices.end(), shows_something);
  const auto last = std::find_if(slices.rbegin(), slices.rend(), shows_something).base();
  std::vector<int> lost;
  std::multimap<double, int> by_skewness;  // whole slices are compared only where it is about the same
  for (auto slice = first; slice < last; ++slice) {
    const auto number = static_cast<int>(slice - slices.begin());
    if (!shows_something(*slice)) {
      lost.push_back(number);
      continue;
    }
    const Eigen::ArrayXf values = standardised(*slice);
    const double skewness = values.cast<double>().cube().mean();
    const double unlike = 1e-3 * (1 + std::abs(skewness));
    const auto end = by_skewness.upper_bound(skewness + unlike);
    for (auto other = by_skewness.lower_bound(skewness - unlike); other != end; ++other)
      if (are_copies(values, standardised(slices[static_cast<std::size_t>(other->second)])))
        lost.insert(lost.end(), {other->second, number});
    by_skewness.emplace(skewness, number);
  }
  std::sort(lost.begin(), lost.end());
  lost.erase(std::unique(lost.begin(), lost.end()), lost.end());
  return lost;
}

}  // namespace emmetrope::segmentation
