#pragma once
#include <filesystem>
#include <optional>
#include <vector>

#include "pipeline/base/command_line.hpp"
#include "segmentation/intake/series_choice.hpp"

namespace emmetrope::segmentation {

struct SegmentOptions {
  std::filesystem::path study;
  std::filesystem::path case_folder;
  std::vector<SeriesChoice> series;  ///< by UID or number in the inventory; empty: choose
  bool any_modality = false;
  std::optional<double> age_years;  ///< default: the study's
  /// label volumes corrected by hand, one a stack; never written to
  std::vector<std::filesystem::path> labels;

  /// \throw Error (usage) naming the field
  void check() const;
};

/// Reads a study, finds the eyes, fits each and writes CASE/segmentation and CASE/case.json. Status done
/// (both eyes, or the one asked for), partial (one of two) or no_result.
/// \throw Error (input_invalid, unsupported) for a study that cannot be read
Answer segment(const SegmentOptions& options, const CommonOptions& common);

}  // namespace emmetrope::segmentation
