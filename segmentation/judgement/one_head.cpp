#include "segmentation/judgement/one_head.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/population/limits.hpp"

namespace emmetrope::segmentation {
namespace {

/// Where a globe lies in each stack that it was fitted to, LPS.
std::map<const Stack*, Eigen::Vector3d> globe_centres(const JudgedEye& eye) {
  std::map<const Stack*, Eigen::Vector3d> centres;
  const auto add = [&](const JudgedEye& reading) {
    if (!reading.is_fitted()) return;
    const EyeFit& fit = *reading.fit;
    for (std::size_t s = 0; s < fit.stacks.size(); ++s)
      centres.emplace(fit.stacks[s].stack, fit.globe_centre_lps() - fit.head_shift_lps(s));
  };
  add(eye);
  std::for_each(eye.in_other_contrast.begin(), eye.in_other_contrast.end(), add);
  return centres;
}

}  // namespace

void check_one_head(const std::vector<JudgedEye>& eyes) {
  if (eyes.size() != 2) return;
  const auto right = globe_centres(eyes[0]), left = globe_centres(eyes[1]);
  struct Apart {
    const Stack* stack;
    double mm;
  };
  std::vector<Apart> globes;
  for (const auto& [stack, centre] : right)
    if (const auto other = left.find(stack); other != left.end())
      globes.push_back({stack, (other->second - centre).norm()});
  if (globes.size() < 2) return;
  const auto [near, far] = std::minmax_element(globes.begin(), globes.end(),
                                               [](const Apart& a, const Apart& b) { return a.mm < b.mm; });
  if (limits_of("globes_apart_difference_mm").accepted.contains(far->mm - near->mm)) return;
  throw input_error(
      fmt::format(
          "the globes lie {:.1f} mm apart in {} and {:.1f} mm in {}: these are not images of one head",
          near->mm, near->stack->name, far->mm, far->stack->name),
      "choose the series of one person by --series");
}

}  // namespace emmetrope::segmentation
