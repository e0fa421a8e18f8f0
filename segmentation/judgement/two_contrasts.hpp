#pragma once
#include <vector>

#include "segmentation/judgement/judged_eye.hpp"

/// The eyes in T1 and in T2 of one session.
namespace emmetrope::segmentation {

/// Whether the eye should be fitted to images of the other contrast: they say at least a tenth as much, or something is
/// withheld.
bool is_other_contrast_wanted(const JudgedEye& eye, const FoundEye& in_other_contrast);

/// Puts two readings of each eye together, each fitted to its own contrast by itself. The first stands unless more of an eye
/// is known by the other, or both measured every eye and the other's lengths are known better: one contrast for both, as
/// the head moves between them. Where both know lens, chamber and length, they are joined (both_contrasts.hpp), the cornea
/// only where both measured it; where one of these or the globe's width or height is more than three standard deviations of
/// both apart, they contradict each other: a warning says so, and the intervals are wider for it. What one contrast shows
/// that no healthy eye has (oil, blood, an implant, a mass) counts for both; what a fit shows that is refused for something
/// else does not, but for a mass that lies in the vitreous of the reading that stands.
void put_together(std::vector<JudgedEye>& eyes, std::vector<JudgedEye> in_other_contrast);

/// Says of each stack of a contrast what became of it, and marks those that are used.
void explain_contrasts(std::vector<StackChoice>& choices, const std::vector<JudgedEye>& eyes);

}  // namespace emmetrope::segmentation
