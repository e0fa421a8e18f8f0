#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/pacs/archive_settings.hpp"

namespace emmetrope::pacs {

/// What studies are asked for; empty fields are not. A date is YYYYMMDD or a range of two with "-".
struct StudyQuery {
  std::string study_uid, patient_id, accession_number, study_date;
};

/// A study that an archive has.
struct FoundStudy {
  std::string uid, date, description, modalities, accession_number;
  std::string patient_id;  ///< to tell two patients' studies apart, said nowhere
};

/// Where two patients have one StudyInstanceUID, no query parts them.
inline constexpr const char* shared_uid_remedy =
    "let the archive's keeper give each patient's study a UID of its own, or export the images of one as files";

/// A series of MR images.
struct FoundSeries {
  std::string uid;
  std::vector<std::string> images;  ///< their SOPInstanceUIDs, without other objects of the series
};

/// An archive that speaks DICOM (PS3.4 C, PS3.7), over TLS where the settings say so. Every call is an association of its
/// own.
class Archive {
 public:
  explicit Archive(ArchiveSettings settings);

  /// C-FIND, study root. Studies of another accession number or date than was asked for are left out: an archive may pass
  /// over a key.
  /// \throw Error (input_invalid) naming the archive and what it said
  std::vector<FoundStudy> find_studies(const StudyQuery& query) const;
  std::vector<FoundSeries> find_mr_series(const std::string& study_uid) const;
  /// C-GET, byte by byte into `folder` as 00001.dcm and so on.
  /// \param asked  the study, and what else each of its images must say
  /// \param received  called after each file
  /// \return how many files
  /// \throw Error (input_invalid) where it fails, other images arrive than those of `series`, or one is of another patient
  ///   or study, or of another accession number or date than was asked for
  std::size_t get(const StudyQuery& asked, const std::vector<FoundSeries>& series,
                  const std::filesystem::path& folder, const std::function<void()>& received) const;
  /// C-STORE. Warns of each file that the archive took and changed.
  /// \param sent  called after each file
  /// \throw Error (not_writable) naming the file that the archive did not take, and why
  void store(const std::vector<std::filesystem::path>& files, const std::function<void()>& sent) const;

 private:
  ArchiveSettings settings_;
};

}  // namespace emmetrope::pacs
