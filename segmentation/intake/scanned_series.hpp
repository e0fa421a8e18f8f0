#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "segmentation/intake/wire.hpp"

/// The files and images of a series, as the decoding process told them.
namespace emmetrope::segmentation {

/// Of the stored values of one frame.
struct FrameStatistics {
  std::int32_t minimum = 0, maximum = 0;
  std::int64_t sum = 0;
  std::uint64_t count = 0;
  std::size_t hash = 0;  ///< of all in their order
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
  /// One of a classic image
  int frame_count() const;
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

/// For a message: the file, the tag, and its value or that it is absent.
std::string found(const ScannedFile& file, const Tag& tag, int frame = 0);
std::string found(const SeriesImage& image, const Tag& tag);

std::optional<double> number_of(const ScannedFile& file, const Tag& tag);

/// Which part of the complex image an image shows: MAGNITUDE, PHASE, REAL, ...; a classic one says it by a word of its
/// type.
std::string component_of(const SeriesImage& image);

}  // namespace emmetrope::segmentation
