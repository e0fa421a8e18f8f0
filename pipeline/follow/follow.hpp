#pragma once
#include <filesystem>
#include <vector>

#include "pipeline/base/command_line.hpp"

namespace emmetrope::follow {

struct FollowOptions {
  std::vector<std::filesystem::path> visits;  ///< cases, the first visit first
  std::filesystem::path output;
  std::vector<double> years;  ///< of the visits, where the studies do not tell; from any beginning
  /// Relative standard deviation of the scanner's scale from visit to visit: one scanner that is looked after (chosen).
  double scale_sigma = 0.001;
};

/// Fits the visits of one person together and writes OUT/growth.json, growth.html and growth.pdf.
/// \return done; partial where an eye could not be followed, no_result where none could
/// \throw Error (usage) fewer than two visits, years that contradict the studies' dates or ages, (input_invalid) a case
///   that is not finished, visits of two persons, of one study or scan, or out of order, more than two visits whose dates
///   nobody tells
Answer run_follow(const FollowOptions& options, const CommonOptions& common);

}  // namespace emmetrope::follow
