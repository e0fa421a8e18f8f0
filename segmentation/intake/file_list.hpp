#pragma once
#include <filesystem>
#include <vector>

#include "segmentation/intake/study.hpp"

namespace emmetrope::segmentation {

struct FileList {
  std::filesystem::path root;
  std::vector<std::filesystem::path> files;  ///< relative to root, sorted
  std::vector<SkippedFile> skipped;
};

/// Regular files at and below `study`, links followed, each file and folder once (by inode): a loop of links
/// ends. What is no regular file, empty or not readable is listed as skipped.
/// \throw Error (input_invalid) when the study does not exist or exceeds the limits
FileList list_files(const std::filesystem::path& study, const IntakeLimits& limits);

}  // namespace emmetrope::segmentation
