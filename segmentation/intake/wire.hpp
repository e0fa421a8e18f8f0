#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "segmentation/intake/tags.hpp"
#include "segmentation/intake/volume.hpp"

/// What the decoding process tells its parent, over a pipe: `ready` when it has started, then of each file when asked
/// by a Request and the file's name, ended by a zero byte. Each message is a type, its length as 8 bytes in the
/// machine's order, and the bytes: first `header` (JSON of ImageHeader), then for an image `frame` for each frame (int32 samples, row after row, stored
/// values without rescale), at the end `end` (JSON of DecodeEnd); of a header alone there are no frames. For a NIfTI
/// file, which is known by its name: `volume` (JSON of VolumeHeader), then for each slice `frame` (float32 intensities,
/// row after row).
namespace emmetrope::segmentation {

enum class Request : char { everything = 'E', header = 'H' };
enum class MessageType : char { ready = 'R', header = 'H', frame = 'P', end = 'E', volume = 'V' };

/// How the decoding process ends when it cannot go on.
enum DecoderStatus : int { no_dictionary = 2, out_of_memory = 3 };

/// Whether a file is read as NIfTI: .nii or .nii.gz.
bool is_nifti_name(const std::filesystem::path& file);

enum class FileKind {
  not_dicom,  ///< no DICOM file
  directory,  ///< a DICOMDIR
  no_image,   ///< DICOM without pixels: reports, presentation states
  image,
  damaged,  ///< DICOM that cannot be parsed to its end; its tags are what could be read
};

/// InPlanePhaseEncodingDirection of a volume whose rows and columns are both phase-encoded, as it was turned since its
/// acquisition.
inline constexpr const char* both_phase_encodings = "ROW\\COL";

/// Values by keyword, as text; several values are separated by backslashes. Absent attributes have no entry.
using TagValues = std::map<std::string, std::string>;

struct ImageHeader {
  FileKind kind = FileKind::not_dicom;
  std::string reason{};           ///< why it is not an image
  std::string transfer_syntax{};  ///< UID
  std::string description{};      ///< SeriesDescription in UTF-8
  /// Keywords of texts that are not in their character set, or in one that cannot be converted
  std::set<std::string> unreadable{};
  TagValues data_set{};
  std::vector<TagValues> frames{};  ///< functional groups of each frame; one empty entry for a classic image

  /// The value for a frame: its functional group's, else the data set's, else empty.
  const std::string& value(const Tag& tag, int frame = 0) const;
  bool has(const Tag& tag, int frame = 0) const { return !value(tag, frame).empty(); }
};

struct DecodeEnd {
  std::string error;              ///< empty when all frames were decoded; names the tag
  bool unsupported = false;       ///< the error is a kind of data that we do not read
  bool stray_bits = false;        ///< samples had bits set outside BitsStored
  std::uint64_t extra_bytes = 0;  ///< pixel data beyond the last frame and its padding
};

/// A NIfTI volume but for its intensities, or why it cannot be read.
struct VolumeHeader {
  Stack geometry;     ///< slice_intensity is empty
  TagValues sidecar;  ///< of its acquisition (sidecar.hpp)
  std::vector<std::string> warnings;
  std::string error, remedy;  ///< of an Error; empty when the volume was read
  ExitStatus status = ExitStatus::done;
};

void to_json(Json& json, const VolumeHeader& header);
void from_json(const Json& json, VolumeHeader& header);
void to_json(Json& json, const ImageHeader& header);
void from_json(const Json& json, ImageHeader& header);
void to_json(Json& json, const DecodeEnd& end);
void from_json(const Json& json, DecodeEnd& end);

}  // namespace emmetrope::segmentation
