#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"

class DcmItem;

namespace emmetrope::report {

/// One image of the study that the case was made from.
struct SourceImage {
  std::string sop_class_uid, sop_instance_uid, series_uid, frame_of_reference_uid;
  Eigen::Vector3d position_lps{0, 0, 0};
  Eigen::Vector3d normal{0, 0, 1};
};

/// What segmentation noted of the study that it read.
struct NotedStudy {
  std::set<std::string> sha256;  ///< of all its files
  /// How many files each used series has, by UID; none where NIfTI volumes, which name no patient, are among them
  std::map<std::string, std::size_t> files_of_used;
};
/// \param stage_json  segmentation's
NotedStudy noted_study(const Json& case_json, const Json& stage_json);

/// The DICOM library's own messages would tell tags of the patient: failures come as our errors and notes
/// instead.
void quiet_dicom_library();

/// Who a header without identity is of.
struct Deidentified {
  std::string subject;   ///< for PatientName and PatientID
  std::string study;     ///< tells the study from others of that subject; UIDs are made from both
  std::string age, sex;  ///< as DICOM has them, "040Y" and "F"; empty unless they are kept
};

/// The patient and the study that the report's DICOM objects belong to, with the images behind the result.
class SourceStudy {
 public:
  /// Reads the headers of the files that segmentation read, known by their bytes; others are not opened. A
  /// child process parses them (segmentation/intake/decoder.hpp).
  /// \throw Error (input_invalid) when a file of a used series is not there as it was (it is another study, or another
  ///   patient's), or has no StudyInstanceUID, or a PatientID that cannot be converted
  static SourceStudy read(const std::filesystem::path& study, const NotedStudy& noted);
  /// Where the study is not at hand: a patient named by the pseudonym, a study of its own.
  static SourceStudy pseudonymous(const std::string& subject, const std::string& study_date);
  /// By PS3.15 annex E: what table E.1-1 names of these modules is removed or without value, UIDs are made anew from the
  /// subject, and no image of the source is referred to; how, stands in the header itself.
  static SourceStudy deidentified(const Deidentified& header);

  SourceStudy(SourceStudy&&) noexcept;
  SourceStudy& operator=(SourceStudy&&) noexcept;
  ~SourceStudy();

  /// Patient, Patient Study and General Study modules; dates and times that are none are left out.
  const DcmItem& header() const { return *header_; }
  const std::vector<SourceImage>& images() const { return images_; }
  /// What the objects lack of the patient and the study; the patient's values are not told.
  const std::vector<std::string>& warnings() const { return warnings_; }
  std::string study_uid() const;
  /// YYYYMMDD; of the study, or empty where its header has none.
  std::string known_date() const;
  /// The same for objects that need one: 20000101 where it is not known.
  std::string date() const;
  std::string time() const;
  /// "Jane Doe, born 1961-02-03", UTF-8.
  std::string identity() const;
  /// To tell whether two studies are of one patient; never to be shown or written.
  std::string patient_id() const;
  std::string birth_date() const;
  /// Changes when the header or an image does.
  std::string fingerprint() const;

 private:
  SourceStudy();
  std::string text(unsigned short group, unsigned short element) const;
  std::unique_ptr<DcmItem> header_;
  std::vector<SourceImage> images_;
  std::vector<std::string> warnings_;
};

}  // namespace emmetrope::report
