#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "segmentation/intake/volume.hpp"
#include "segmentation/intake/wire.hpp"

/// The JSON files that converters (dcm2niix, BIDS) leave with a NIfTI volume (sidecar_files.hpp): what the DICOM headers
/// told of the acquisition.
namespace emmetrope::segmentation {

/// What a volume's sidecars tell of the acquisition, the nearest first, by DICOM's keywords and in DICOM's units (times
/// in ms), as a header would: type, sequence, times, field, bandwidth; InPlanePhaseEncodingDirection of the volume as
/// stored; SliceThickness where its slices are those that were acquired. Nothing that names a person is read. Empty
/// where there is none.
/// \param volume    absolute; its sidecars are read in this process
/// \param geometry  the volume's: converters turn 3-D volumes, and say of the images before that how they lay
/// \param warnings  of what cannot be read, which is left out
TagValues read_sidecar(const std::filesystem::path& volume, const Stack& geometry,
                       std::vector<std::string>& warnings);

}  // namespace emmetrope::segmentation
