#pragma once
#include <filesystem>
#include <optional>

#include "pipeline/base/command_line.hpp"
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/dicom/source_study.hpp"

namespace emmetrope::report {

struct ReportOptions {
  std::filesystem::path case_folder;
  /// The DICOM study that the case was made from; empty: where segmentation found it
  std::filesystem::path study;
  bool identified = false;  ///< name and birth date of the study's header on the pages
  bool no_face = false;     ///< the viewer's volume without the face's surface
};

/// Makes CASE/report/: report.html, report.pdf and the DICOM and FHIR objects. A refused case has a report
/// too, which says why and gives no number: the answer's status is `done`.
/// \throw Error (input_invalid) when the case lacks a segmentation or a file of it is broken
Answer write_report(const ReportOptions& options, const CommonOptions& common);

/// The DICOM study that segmentation read, where it is still at hand.
std::optional<SourceStudy> source_study_of(const CaseData& data);

}  // namespace emmetrope::report
