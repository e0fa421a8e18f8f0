#pragma once
#include <filesystem>
#include <map>
#include <vector>

#include "segmentation/intake/study.hpp"

namespace emmetrope::segmentation {

struct FileList {
  std::filesystem::path root;                ///< absolute, without links
  std::vector<std::filesystem::path> files;  ///< sorted; relative to root, absolute above it
  std::vector<SkippedFile> skipped;
  /// Of each NIfTI volume, the nearest first; also those that are skipped, as links to other files or to nothing
  std::map<std::filesystem::path, std::vector<std::filesystem::path>> sidecars;
};

/// Regular files at and below `study`, links followed, each file and folder once (by inode): a loop of links
/// ends. What is no regular file, empty or not readable is listed as skipped. The sidecars of NIfTI volumes are among
/// them (sidecar_files.hpp), wherever they lie.
/// \throw Error (input_invalid) when the study does not exist or exceeds the limits
FileList list_files(const std::filesystem::path& study, const IntakeLimits& limits);

}  // namespace emmetrope::segmentation
