#pragma once
#include <vector>

#include "segmentation/intake/scanned_series.hpp"
#include "segmentation/intake/study.hpp"

/// What the headers of a series tell of it, before it is judged.
namespace emmetrope::segmentation {

/// Identity, size and transfer syntax.
/// \param files  at least one
void describe_series(const std::vector<ScannedFile>& files, SeriesInfo& info);

/// What the first image says of its acquisition; the others have to agree.
/// \param images  at least one
void describe_images(const std::vector<SeriesImage>& images, SeriesInfo& info);

/// Least, largest and mean value of all images, after rescale.
/// \param images  with the statistics of their frames
void add_statistics(const std::vector<SeriesImage>& images, SeriesInfo& info);

}  // namespace emmetrope::segmentation
