#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "pipeline/base/command_line.hpp"
#include "pipeline/report/dicom/source_study.hpp"

namespace emmetrope::report {

/// Whether two studies are of one patient, in a sentence.
struct PatientsRemark {
  std::string text;
  bool is_doubt = false;  ///< their headers speak against it
};
/// As far as the headers tell; nothing: a study is not at hand.
/// \throw Error (input_invalid) when they are of two
PatientsRemark patients_of(const std::optional<SourceStudy>& earlier,
                           const std::optional<SourceStudy>& later);

/// Two dates of one patient side by side: HTML and PDF in LATER/comparison/. A difference counts as a change
/// when it exceeds the 95 % interval of a difference of independent measurements, sqrt(h_a^2 + h_b^2) with
/// the half widths h.
/// \throw Error (input_invalid) when a case lacks its results
Answer write_comparison(const std::filesystem::path& earlier, const std::filesystem::path& later,
                        const CommonOptions& common);

}  // namespace emmetrope::report
