#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "segmentation/intake/study.hpp"
#include "segmentation/intake/wire.hpp"

/// What makes a series usable. Rules and tolerances are listed in docs/use/reading-dicom.md.
namespace emmetrope::segmentation {

/// Of the stored values of one frame.
struct FrameStatistics {
  std::int32_t minimum = 0, maximum = 0;
  std::int64_t sum = 0;
  std::uint64_t count = 0;
};

/// One file as the decoding process told it.
struct ScannedFile {
  std::filesystem::path file;  ///< relative to the study
  std::size_t number = 0;      ///< among the study's files, from 1
  ImageHeader header{};
  DecodeEnd end{};
  std::vector<FrameStatistics> frames{};
  bool is_sidecar = false;  ///< of a NIfTI volume, its fields those of a header

  /// A mention (file_mention.hpp): the file, or "slice 12" by its InstanceNumber
  std::string name() const;
};

/// One image of a series: a file, or a frame of a multi-frame file.
struct SeriesImage {
  const ScannedFile* source;
  int frame;
  Eigen::Vector3d position_mm;
  double slope, intercept;

  const std::string& value(const Tag& tag) const { return source->header.value(tag, frame); }
  /// A mention of the file, with " frame 3" where it has several
  std::string name() const;
};

/// The warning of a series or volume of one slice or two; empty of more.
std::string too_few_slices(int slices);

/// What an image that is a part of the signal says for which no eye is measured in it; empty of others.
std::string why_unfit(DixonPart part);

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
