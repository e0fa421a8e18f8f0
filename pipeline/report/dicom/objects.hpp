#pragma once
#include <filesystem>
#include <string>

#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/report/case/case_data.hpp"
#include "pipeline/report/dicom/source_study.hpp"

/// The report as DICOM objects of the source's study, each a series of its own; bytes of Part 10 files.
namespace emmetrope::report {

/// Encapsulated PDF.
std::string pdf_object(const SourceStudy& source, const std::string& pdf, bool identified,
                       const std::string& result);

/// Whether an eye's refraction is at the cornea, no spectacle's.
bool is_of_contact_lens(const EyeData& eye);
/// What the coded powers do not say of a refraction: "The cylinder may be none: its axis is not determined. In light of
/// 555 nm. "
std::string conditions_of(const Json& prescription);
/// Spectacle Prescription Report (SR, TID 2020), PARTIAL and UNVERIFIED, of the eyes that have a
/// prescription of a spectacle; empty when none has.
std::string prescription_object(const SourceStudy& source, const CaseData& data, const std::string& result);

/// Measurement report (SR, TID 1500): every number of biometry.json with its interval; empty when there is
/// none.
std::string biometry_object(const SourceStudy& source, const CaseData& data, const std::string& result);

/// Encapsulated STL of one surface, mm, in the patient's frame.
std::string mesh_object(const SourceStudy& source, const TriangleMesh& mesh_lps, Laterality eye,
                        const std::string& surface, int number, const std::string& result);

/// Secondary Capture of a retinal image.
/// \param rgb  rows x columns x 3 bytes
std::string picture_object(const SourceStudy& source, const std::string& rgb, int rows, int columns,
                           Laterality eye, const std::string& title, int number, const std::string& result);

/// Segmentation (SEG) of one stack's label volume, a segment per label of these eyes, coded and with laterality; empty
/// where it has none.
/// \param series_uid  whose images the stack was made of; empty where it is not known
std::string segmentation_object(const SourceStudy& source, const std::filesystem::path& label_nifti,
                                const Json& labels_json, const std::vector<EyeData>& eyes,
                                const std::string& series_uid, int number, const std::string& result);

/// RT Structure Set: closed outlines of lens and eye on the images of one series, sub-voxel, from the meshes; empty where
/// the series is not in the source or no mesh meets its images.
/// \param stack  the series' name in the case: only eyes that were fitted to it are where the images show them
/// \param number  among the case's structure sets, from 1
std::string structure_set_object(const SourceStudy& source, const CaseData& data,
                                 const std::string& series_uid, const std::string& stack, int number,
                                 const std::string& result);

}  // namespace emmetrope::report
