#include "segmentation/intake/lost_slices.hpp"

#include <algorithm>
#include <map>
#include <numeric>

namespace emmetrope::segmentation {
namespace {

bool shows_something(const std::vector<float>& slice) {
  return std::any_of(slice.begin(), slice.end(), [&](float value) { return value != slice.front(); });
}

}  // namespace

std::vector<int> find_lost_slices(const Stack& stack) {
  const auto& slices = stack.slice_intensity;
  const auto first = std::find_if(slices.begin(), slices.end(), shows_something);
  const auto last = std::find_if(slices.rbegin(), slices.rend(), shows_something).base();
  std::vector<int> lost;
  std::map<double, std::vector<int>>
      with_sum;  // whole slices are compared only where their sums are the same
  for (auto slice = first; slice < last; ++slice) {
    const auto number = static_cast<int>(slice - slices.begin());
    if (!shows_something(*slice)) {
      lost.push_back(number);
      continue;
    }
    std::vector<int>& alike = with_sum[std::accumulate(slice->begin(), slice->end(), 0.0)];
    for (const int other : alike)
      if (slices[static_cast<std::size_t>(other)] == *slice) lost.insert(lost.end(), {other, number});
    alike.push_back(number);
  }
  std::sort(lost.begin(), lost.end());
  lost.erase(std::unique(lost.begin(), lost.end()), lost.end());
  return lost;
}

}  // namespace emmetrope::segmentation
