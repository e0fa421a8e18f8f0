#pragma once
#include <filesystem>
#include <string>

#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/dicom/source_study.hpp"

namespace emmetrope::report {

/// Writes what archives and records take, beside the pages: report.dcm, prescription.dcm, biometry.dcm,
/// segmentation.dcm and structures.dcm (one a stack), dicom/ with meshes and retinal images, and prescription.fhir.json. An
/// object whose data do not exist is not written; one that fails costs a note.
void write_objects(const std::filesystem::path& folder, const CaseData& data, const SourceStudy& source,
                   const std::string& pdf, bool identified, Notes& notes);

/// FHIR R4 VisionPrescription of the eyes that have a prescription; null when none has.
/// \param study_date  YYYY-MM-DD, or empty when it is not known
Json fhir_prescription(const CaseData& data, const std::string& study_date);

/// YYYY-MM-DD from case.json, else from the source study's header; empty when neither knows it.
std::string study_date_of(const CaseData& data, const SourceStudy& source);

}  // namespace emmetrope::report
