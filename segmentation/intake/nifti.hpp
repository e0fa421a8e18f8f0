#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "segmentation/intake/volume.hpp"

/// NIfTI-1 (and, for reading, NIfTI-2) volumes, plain or gzipped. Files are RAS+ as the format asks; stacks
/// are LPS. Stacks with gaps or uneven slices are written on the regular grid that fits them best
/// (slice_grid.hpp): a plane without a slice is NaN in intensities and 0 in labels, and FILE.json beside the
/// intensities gives the exact position of every slice and the largest distance from the grid.
namespace emmetrope::segmentation {

/// Reads a volume with one value a voxel, in this process: of files that we wrote. Files of unknown origin
/// are read by Decoder::decode_volume. The scanner's (sform, else qform) orientation decides; planes that are
/// NaN throughout are gaps, as write_nifti leaves them.
/// \throw Error (input_invalid or unsupported) naming the file and the header field
Stack read_nifti(const std::filesystem::path& file);

/// What read_nifti noticed besides: sform and qform that disagree, and so on.
Stack read_nifti(const std::filesystem::path& file, std::vector<std::string>& warnings);

/// Writes float32 intensities to `file` (.nii or .nii.gz) and the slices' exact positions beside it (.json).
/// Equal stacks give equal bytes.
/// \throw Error (not_writable)
void write_nifti(const std::filesystem::path& file, const Stack& stack);

/// Writes labels on the same grid as write_nifti writes the stack.
/// \param labels  one vector a slice, rows x columns as in Stack::slice_intensity
void write_label_nifti(const std::filesystem::path& file, const Stack& stack,
                       const std::vector<std::vector<std::uint8_t>>& labels);

}  // namespace emmetrope::segmentation
