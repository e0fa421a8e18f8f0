#pragma once
#include <vector>

#include "segmentation/judgement/judged_eye.hpp"

namespace emmetrope::segmentation {

/// Refuses stacks of different people. A head is rigid: however it moved between stacks, its globes, where the fits of
/// both see them, are equally far apart in each.
/// \param eyes  of the study, with what images of the other contrast say
/// \throw Error (input) naming two stacks and what they show
void check_one_head(const std::vector<JudgedEye>& eyes);

}  // namespace emmetrope::segmentation
