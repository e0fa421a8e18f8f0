#include "segmentation/judgement/lost_slice_gate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/eye/population/limits.hpp"
#include "segmentation/intake/lost_slices.hpp"
#include "segmentation/intake/named_planes.hpp"

namespace emmetrope::segmentation {

void judge_lost_slices(JudgedEye& eye, const EyeView& view, const Stack& stack) {
  constexpr double beyond_mm =
      2.5;  // of the vitreous, which the finder sees: the wall, and the cornea before it
  const double reach_mm = view.globe.radius_mm + beyond_mm + stack.slice_spacing_mm() / 2;
  std::vector<int> lost = find_lost_slices(stack);
  lost.erase(std::remove_if(lost.begin(), lost.end(),
                            [&](int slice) {
                              const Eigen::Vector3d to_eye = view.globe.centre - stack.position(0, 0, slice);
                              return std::abs(to_eye.dot(stack.normal)) > reach_mm;
                            }),
             lost.end());
  const char* name = "lost_slices";
  const auto count = static_cast<double>(lost.size());
  const Range allowed = limits_of(name).accepted;
  if (allowed.contains(count)) return;
  eye.gates.push_back(
      {name, count, allowed.high, false, Withholds::fit,
       fmt::format(
           "in place of {}, of {}{} stand another one's pixels, or none: what the eye looks like there is "
           "not known",
           planes_in_words(stack, 2, lost.front(), lost.front()), stack.name,
           lost.size() > 1 ? fmt::format(" (and {} more)", lost.size() - 1) : "")});
  eye.edges.clear();
}

}  // namespace emmetrope::segmentation
