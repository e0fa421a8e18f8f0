#pragma once
#include <vector>

#include "segmentation/intake/study.hpp"
#include "segmentation/judgement/judged_eye.hpp"
#include "segmentation/labels/hand_labels.hpp"

namespace emmetrope::segmentation {

/// case.json: the subject, what the study holds, which stacks are used and why, and what became of each eye.
/// \param series  of each stack
/// \param corneas_coupled  whether the eyes' corneas were fitted as those of one person
Json case_json(const Subject& subject, const StudyInventory& inventory,
               const std::vector<const SeriesInfo*>& series, const FoundEyes& found,
               const std::vector<JudgedEye>& eyes, const std::vector<HandLabels>& labels,
               bool corneas_coupled);

}  // namespace emmetrope::segmentation
