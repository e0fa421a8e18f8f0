#pragma once
#include <string>
#include <vector>

#include "segmentation/intake/scanned_series.hpp"
#include "segmentation/intake/study.hpp"

/// What is said of a series that is used all the same. Listed in docs/use/reading-dicom.md.
namespace emmetrope::segmentation {

/// By which tag a part of the signal says that no eye is measured in it, and why; empty of others.
std::string why_unfit(DixonPart part);
/// What follows it.
inline constexpr const char* used_on_demand = "; used only where --series names it";

/// Whether one of the text's words names a part of the head; of an absent text it is not denied.
bool shows_head(const std::string& body_part);

/// Phase images, computed ones and parts of the signal; sets `computed` and `dixon_part` of `info`.
void warn_of_image_type(const std::vector<SeriesImage>& images, SeriesInfo& info);

/// Slices with more between them than planned gaps, a tenth to a half of their thickness, or that overlap by more than
/// interpolation does.
void warn_of_sparse_slices(SeriesInfo& info);

/// Slices of one value throughout between others, and copies of others: what is missing there is no disease of the eye.
/// Scales that make slices brighter or darker than both their neighbours, or that some slices lack.
/// \param images  in the order of their positions, with the statistics of their frames
void warn_of_slices(const std::vector<SeriesImage>& images, SeriesInfo& info);

/// All that a series of files is warned of.
/// \param images  of the files, at least one
void add_warnings(const std::vector<ScannedFile>& files, const std::vector<SeriesImage>& images,
                  SeriesInfo& info);

}  // namespace emmetrope::segmentation
