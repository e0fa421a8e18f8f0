#pragma once

namespace emmetrope::segmentation {

/// How a stack is weighted, by its look. T2: vitreous brighter than what surrounds the eye; T1: darker.
enum class Weighting { t1, t2 };
inline const char* to_string(Weighting weighting) { return weighting == Weighting::t1 ? "T1" : "T2"; }

}  // namespace emmetrope::segmentation
