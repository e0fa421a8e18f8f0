#pragma once
#include <filesystem>

#include "pipeline/base/interrupt.hpp"

namespace emmetrope {

/// A folder to make results in before they are moved to where they belong, together: empty at first, gone at the end and on
/// an interrupt.
class ScratchFolder {
 public:
  /// \throw Error (not_writable)
  explicit ScratchFolder(std::filesystem::path path);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  RemoveOnInterrupt on_interrupt_;
};

}  // namespace emmetrope
