#pragma once
#include <vector>

#include "segmentation/judgement/judged_eye.hpp"

/// One eye in T1 and in T2 of one session.
namespace emmetrope::segmentation {

/// Whether the eye should be fitted to images of the other contrast: they say at least a tenth as much, or something is
/// withheld.
bool is_other_contrast_wanted(const JudgedEye& eye, const FoundEye& in_other_contrast);

/// Puts two readings of an eye together, each fitted to its own contrast by itself. That of which more is known stands, and
/// of two of which as much is that whose length is known better. Where both know lens, chamber and length, they are joined
/// (both_contrasts.hpp); where one of these or the globe's width or height is more than three standard deviations of both
/// apart, they contradict each other: a warning says so, and the intervals are wider for it.
void put_together(JudgedEye& eye, JudgedEye in_other_contrast);

/// Says of each stack of a contrast what became of it for this eye, and marks those that are used.
void explain_contrasts(std::vector<StackChoice>& choices, const JudgedEye& eye);

}  // namespace emmetrope::segmentation
