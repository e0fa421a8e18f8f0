#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/progress.hpp"
#include "segmentation/intake/series_choice.hpp"
#include "segmentation/intake/volume.hpp"

/// Reading a study: a folder of MR DICOM files (any depth, any names, other files mixed in) or NIfTI volumes.
/// Files are parsed and decoded in a child process with limits (decoder.hpp), judged here
/// (series_checks.hpp). docs/use/reading-dicom.md lists what is accepted, what is warned about and what is
/// refused.
namespace emmetrope::segmentation {

/// What one study may cost; a file beyond them is refused, not half read.
struct IntakeLimits {
  std::size_t files = 20'000;
  int depth = 16;                                    ///< of nested folders
  std::uint64_t file_bytes = 200'000'000;            ///< pixels of one file, decoded
  std::uint64_t series_bytes = 2'000'000'000;        ///< pixels of one series, decoded
  std::uint64_t child_memory_bytes = 1'000'000'000;  ///< address space of the decoding process
  double cpu_s = 4;       ///< processor time for a file, and 0.5 s for each MB of it
  double wall_s = 30;     ///< time for a file, and 1 s for each MB of it
  int hanging_files = 3;  ///< after so many the rest of the study is not decoded
};

struct IntakeOptions {
  IntakeLimits limits;
  Verbosity verbosity;
  bool any_modality = false;  ///< also take series that say that they are not MR, or a secondary capture
  std::vector<SeriesChoice> choices;  ///< by UID: which images of a series with several at one position
};

/// Where a slice of a series comes from.
struct SliceSource {
  std::filesystem::path file;   ///< relative to the study
  int frame = 0;                ///< within the file, from 0
  Eigen::Vector3d position_mm;  ///< ImagePositionPatient, LPS
  double rescale_slope = 1, rescale_intercept = 0;
};

/// What of the signal all images of a series show, where water and fat were told apart by their phases (Dixon).
enum class DixonPart { all, in_phase, opposed_phase, water, fat };

/// What a series says about itself and what the reader thinks of it. Numbers are absent where the files do
/// not give them or are too broken to tell.
struct SeriesInfo {
  std::string name;         ///< file-safe and stable: "stack1"; used for the Stack and its files
  std::string uid;          ///< SeriesInstanceUID; for a NIfTI volume "nifti-" and a hash of its bytes
  std::string description;  ///< clean UTF-8, without what identifies the patient; a NIfTI volume's file
  std::string modality;
  std::string study_uid, frame_of_reference_uid;
  int number = 0;               ///< SeriesNumber
  std::string transfer_syntax;  ///< UID
  std::size_t files = 0;        ///< files used
  int rows = 0, columns = 0;
  std::optional<double> row_spacing_mm, column_spacing_mm;  ///< PixelSpacing 1 and 2
  std::optional<double> slice_spacing_mm;                   ///< median distance of neighbouring slices
  std::optional<double> slice_thickness_mm;                 ///< SliceThickness
  bool uniform = false;                 ///< every slice within 0.02 mm of a regular grid without holes
  std::array<double, 6> orientation{};  ///< direction cosines of a row, then of a column; orthonormal
  std::vector<SliceSource> slices;      ///< ordered by position along row x column
  std::optional<double> minimum, maximum, mean;  ///< of all voxels after rescale

  // What helps to choose a stack and to model its acquisition.
  std::string image_type;        ///< "ORIGINAL\\PRIMARY\\M\\ND"
  bool computed = false;         ///< all of it, from an acquisition that may be another series of the study
  std::string acquisition_type;  ///< "2D" or "3D"
  std::string sequence;          ///< ScanningSequence
  std::string body_part;
  std::string image_laterality;  ///< "R", "L", "B", "U" or empty
  std::optional<double> repetition_time_ms, echo_time_ms, inversion_time_ms, flip_angle_deg;
  std::optional<double> field_strength_T, pixel_bandwidth_Hz;
  /// InPlanePhaseEncodingDirection: "ROW", "COL" or empty; of a turned volume that was read out along its slices both
  std::string phase_encoding;
  /// Philips (2005,100E) slope, (2005,100D) intercept; not applied
  std::optional<std::array<double, 2>> private_scaling;

  std::vector<std::string> warnings;
  bool usable = false;
  std::string reason;    ///< why it is not usable: file, tag, what was found
  bool damaged = false;  ///< a file of it could not be read to its end, by its own fault or the machine's
  /// What a case may keep: the same texts without names of files, which may be the patient's.
  struct {
    std::string description;
    std::vector<std::string> warnings;
    std::string reason;
  } kept;
  ExitStatus refusal = ExitStatus::input_invalid;  ///< input_invalid or unsupported
  DixonPart dixon_part = DixonPart::all;

  bool is_nifti() const { return modality == "NIfTI"; }
};

struct SkippedFile {
  std::filesystem::path file;  ///< relative to the study
  std::string reason;
};

/// The patient without identity.
struct Subject {
  /// Hash of the study's UID (of a series' without one, of the bytes of a volume): the same study gives the same id,
  /// PatientID is not in it
  std::string id;
  std::optional<double> age_years;  ///< PatientAge, or from the dates of birth and of the study
  std::string sex;                  ///< "M", "F", "O" or empty
};

struct StudyInventory {
  std::filesystem::path study;              ///< as given
  std::filesystem::path root;               ///< what `file` paths are relative to
  std::map<std::string, Subject> subjects;  ///< by StudyInstanceUID
  /// Why two series of one study are not of one person at one visit, by their names and the tag; empty where none says so.
  std::string contradiction(const SeriesInfo& one, const SeriesInfo& other) const;
  /// The first of the series for each study and visit that headers tell, as pairs of thousands of series take minutes.
  std::vector<const SeriesInfo*> one_of_each_visit(const std::vector<const SeriesInfo*>& series) const;

  /// By SeriesInstanceUID and keyword, see Patients: identity, never told.
  std::map<std::string, std::map<std::string, std::string>> visits;
  std::vector<SeriesInfo> series;     ///< by SeriesNumber, then UID
  std::vector<SkippedFile> skipped;   ///< by name
  std::vector<SeriesChoice> choices;  ///< that it was read with

  /// \throw Error (input_invalid) listing the series that there are, when there is none with this UID
  const SeriesInfo& find(const std::string& uid) const;
  /// The patient at the time of the series' study. A NIfTI volume names no patient: it is not theirs whose DICOM files
  /// lie beside it.
  Subject subject_of(const SeriesInfo& info) const;
  bool any_usable() const;
  /// Why segmentation does not use the series: its reason, or of a part of the signal that no choice names, that it shows
  /// no eye; empty of the others.
  std::string why_not_used(const SeriesInfo& info) const;
  /// Status of `inventory`: done when a series is used; unsupported when none is but all refusals are of that kind, or a
  /// choice could name a part of the signal; else input_invalid.
  ExitStatus status() const;
};

/// Lists and judges what a study holds. All pixels are decoded once. Series that cannot be used are listed
/// with the reason; only a study that cannot be read at all is an error.
/// \param study  a folder, or one DICOM or NIfTI file
/// \throw Error (input_invalid) when it does not exist or holds too many files
StudyInventory read_inventory(const std::filesystem::path& study, const IntakeOptions& options = {});

/// The voxels of one series of the inventory, every slice at its own position.
/// \throw Error with the series' reason when it is not usable, (input_invalid) when its files changed
///   meanwhile
Stack read_series(const StudyInventory& inventory, const std::string& uid, const IntakeOptions& options = {});

/// The document of `emmetrope inventory --json` as docs/use/reading-dicom.md describes it.
Json to_json(const StudyInventory& inventory);
/// One element of "series"; unknown numbers are null.
Json to_json(const SeriesInfo& series);
/// The same for a case: slices are named by their number, not by their file.
Json kept_json(const SeriesInfo& series);
/// {"id", "age_years" (null when unknown), "sex"}
Json to_json(const Subject& subject);

/// The same for people: a table of the series, the reasons and the warnings.
std::string describe(const StudyInventory& inventory);

}  // namespace emmetrope::segmentation
