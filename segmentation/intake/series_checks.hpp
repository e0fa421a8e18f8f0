#pragma once
#include <string>
#include <vector>

#include "segmentation/intake/scanned_series.hpp"
#include "segmentation/intake/study.hpp"

/// What makes a series usable. Rules and tolerances are listed in docs/use/reading-dicom.md.
namespace emmetrope::segmentation {

/// The warning of a series or volume of one slice or two; empty of more.
std::string too_few_slices(int slices);

/// What the sidecar of a NIfTI volume tells of its acquisition, judged as a header is.
/// \throw Error (unsupported) of what is no slices as acquired
void judge_sidecar(const ScannedFile& sidecar, const IntakeOptions& options, SeriesInfo& info);

/// Describes and judges the files of one SeriesInstanceUID.
/// \param files  one of each SOP instance, at least one; their order does not matter
SeriesInfo judge_series(std::vector<ScannedFile> files, const IntakeOptions& options);

/// Orders the images along the normal of info.orientation and judges their positions: duplicates, shear,
/// gaps, uneven spacing. Sets slices, slice_spacing_mm, uniform and warnings of `info`.
/// \throw Error (input_invalid)
void judge_positions(std::vector<SeriesImage> images, SeriesInfo& info);

}  // namespace emmetrope::segmentation
