#pragma once
#include <optional>
#include <string>

namespace emmetrope::segmentation {

/// How a stack is weighted, by its look. T2: vitreous brighter than what surrounds the eye; T1: darker.
enum class Weighting { t1, t2 };
inline const char* to_string(Weighting weighting) { return weighting == Weighting::t1 ? "T1" : "T2"; }

/// Of a sequence, each where it is told.
struct SequenceTimes {
  std::optional<double> repetition_ms, echo_ms, inversion_ms, flip_angle_deg;
  std::string scanning_sequence = {};  ///< "SE", "GR", "IR", or several; empty: not told
};

/// What a sequence's times leave no doubt of, whatever fills the eye: T1 by spin echoes within 15 ms, repeated after 0.25
/// to 1.1 s, or an inversion 0.3 to 1.4 s before; T2 by echoes after 60 ms, repeated after 1.5 s and more. Empty for
/// others: FLAIR, proton density, gradient echoes (T2* or balanced), an inversion whose time is not told.
std::optional<Weighting> weighting_by_times(const SequenceTimes& times);

}  // namespace emmetrope::segmentation
