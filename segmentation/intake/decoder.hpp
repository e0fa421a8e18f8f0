#pragma once
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "segmentation/intake/study.hpp"
#include "segmentation/intake/wire.hpp"

namespace emmetrope::segmentation {

/// Parses and decodes DICOM files and NIfTI volumes in a child process, emmetrope-decode, with limits on
/// memory, processor time and wall clock. A file on which the child crashes, hangs or runs out of memory is
/// reported as damaged; the next file gets a new child.
class Decoder {
 public:
  explicit Decoder(const IntakeLimits& limits);
  ~Decoder();
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  struct File {
    ImageHeader header;
    DecodeEnd end;
  };
  /// Stored values of one frame without rescale, rows x columns.
  using FrameSink = std::function<void(int frame, const std::vector<std::int32_t>& samples)>;

  /// \throw Error (fault) when the child cannot be started
  File decode(const std::filesystem::path& file, const FrameSink& sink);

  /// The header alone, as `decode` has it.
  ImageHeader header(const std::filesystem::path& file);

  struct Volume {
    Stack stack;
    TagValues sidecar;  ///< see read_sidecar
    std::vector<std::string> warnings;
  };
  /// A NIfTI volume, see read_nifti.
  /// \throw Error as that does, or (input_invalid) naming the file where the child did not survive it
  Volume decode_volume(const std::filesystem::path& file);

 private:
  class Child;
  /// Sends the file's name to a child.
  /// \return when its answer must be there
  std::chrono::steady_clock::time_point ask(const std::filesystem::path& file, Request request);
  File decode(const std::filesystem::path& file, Request request, const FrameSink& sink);
  IntakeLimits limits_;
  std::unique_ptr<Child> child_;
  int hangs_ = 0;
};

}  // namespace emmetrope::segmentation
