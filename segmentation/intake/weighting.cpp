#include "segmentation/intake/weighting.hpp"

namespace emmetrope::segmentation {
namespace {

bool is_within(const std::optional<double>& value, double least, double most) {
  return value && *value >= least && *value <= most;
}

}  // namespace

std::optional<Weighting> weighting_by_times(const SequenceTimes& times) {
  constexpr double longest_echo_of_t1_ms = 15, shortest_echo_of_t2_ms = 60, longest_ms = 1e5;
  constexpr double least_inversion_ms = 300, most_inversion_ms = 1400;  // between STIR's and FLAIR's
  constexpr double least_flip_of_spin_echo_deg = 50;
  const auto is_a = [&](const char* kind) { return times.scanning_sequence.find(kind) != std::string::npos; };
  const bool is_inverted = times.inversion_ms && *times.inversion_ms > 0;
  if (!is_inverted && is_a("IR")) return std::nullopt;  // by a time that is not told
  if (is_within(times.echo_ms, 0.1, longest_echo_of_t1_ms)) {
    if (is_within(times.inversion_ms, least_inversion_ms, most_inversion_ms)) return Weighting::t1;
    if (!is_inverted && !is_a("GR") && is_within(times.repetition_ms, 250, 1100) &&
        is_within(times.flip_angle_deg, least_flip_of_spin_echo_deg, 180))
      return Weighting::t1;
  }
  if (is_within(times.echo_ms, shortest_echo_of_t2_ms, longest_ms) &&
      is_within(times.repetition_ms, 1500, longest_ms) &&
      (!is_inverted || *times.inversion_ms < least_inversion_ms))
    return Weighting::t2;
  return std::nullopt;
}

}  // namespace emmetrope::segmentation
