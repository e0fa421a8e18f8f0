#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "segmentation/intake/volume.hpp"
#include "segmentation/intake/wire.hpp"

/// The JSON file that converters (dcm2niix, BIDS) leave beside a NIfTI volume, under its name: what the DICOM headers
/// told of the acquisition.
namespace emmetrope::segmentation {

/// T1.json of T1.nii and T1.nii.gz.
std::filesystem::path sidecar_of(std::filesystem::path volume);

/// What a sidecar tells of the acquisition, by DICOM's keywords and in DICOM's units (times in ms), as a header would: type,
/// sequence, times, field, bandwidth; InPlanePhaseEncodingDirection of the volume as stored; SliceThickness where its slices
/// are those that were acquired. Nothing that names a person is read. Empty where there is no sidecar.
/// \param volume    its sidecar is read in this process
/// \param geometry  the volume's: converters turn 3-D volumes, and say of the images before that how they lay
/// \param warnings  of what cannot be read, which is left out
TagValues read_sidecar(const std::filesystem::path& volume, const Stack& geometry,
                       std::vector<std::string>& warnings);

}  // namespace emmetrope::segmentation
