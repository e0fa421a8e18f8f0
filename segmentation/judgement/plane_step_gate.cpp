#include "segmentation/judgement/plane_step_gate.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/eye/population/limits.hpp"
#include "segmentation/finding/plane_steps.hpp"
#include "segmentation/intake/named_planes.hpp"

namespace emmetrope::segmentation {

void judge_plane_steps(JudgedEye& eye, const EyeView& view, const Stack& stack) {
  const bool has_moved = std::any_of(eye.gates.begin(), eye.gates.end(), [](const QualityGate& gate) {
    return gate.name == "slice_displacement_mm" && !gate.passed;
  });
  if (has_moved) return;
  constexpr double of_wall_mm = 1;
  const auto step = largest_plane_step(stack, view.globe.centre, view.globe.radius_mm + of_wall_mm);
  const char* name = "plane_step_ratio";
  const Range allowed = limits_of(name).accepted;
  if (!step || allowed.contains(step->ratio)) return;
  eye.gates.push_back(
      {name, step->ratio, allowed.high, false, Withholds::fit,
       fmt::format("between {} in {} the image changes {:.1f} times as much as between those beside them: a "
                   "plane is missing there, or the head moved, and lengths across it are not known",
                   planes_in_words(stack, step->axis, step->first, step->first + 1), stack.name,
                   step->ratio)});
  eye.edges.clear();
}

}  // namespace emmetrope::segmentation
