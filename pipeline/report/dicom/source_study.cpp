#include "pipeline/report/dicom/source_study.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

#include <algorithm>
#include <array>
#include <set>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/report/dicom/object.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_files = 20'000;

/// What an object of the same study must repeat, so that an archive files it with its patient.
const std::array<DcmTagKey, 24>& study_tags() {
  static const std::array<DcmTagKey, 24> tags{DCM_SpecificCharacterSet,
                                              DCM_PatientName,
                                              DCM_PatientID,
                                              DCM_IssuerOfPatientID,
                                              DCM_PatientBirthDate,
                                              DCM_PatientBirthTime,
                                              DCM_PatientSex,
                                              DCM_OtherPatientNames,
                                              DCM_EthnicGroup,
                                              DCM_PatientComments,
                                              DCM_PatientIdentityRemoved,
                                              DCM_DeidentificationMethod,
                                              DCM_DeidentificationMethodCodeSequence,
                                              DCM_PatientAge,
                                              DCM_PatientSize,
                                              DCM_PatientWeight,
                                              DCM_StudyInstanceUID,
                                              DCM_StudyDate,
                                              DCM_StudyTime,
                                              DCM_ReferringPhysicianName,
                                              DCM_StudyID,
                                              DCM_AccessionNumber,
                                              DCM_StudyDescription,
                                              DCM_IssuerOfAccessionNumberSequence};
  return tags;
}

/// Type 2 attributes: present even where the source has none.
void complete(DcmItem& header) {
  for (const auto& tag : {DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyDate,
                          DCM_StudyTime, DCM_ReferringPhysicianName, DCM_StudyID, DCM_AccessionNumber})
    if (!header.tagExists(tag)) header.insertEmptyElement(tag);
}

std::string text_of(DcmItem& item, const DcmTagKey& tag) {
  OFString value;
  return item.findAndGetOFStringArray(tag, value).good() ? std::string(value.c_str()) : std::string();
}

Eigen::Vector3d vector_of(DcmItem& item, const DcmTagKey& tag, unsigned long first) {
  Eigen::Vector3d vector(0, 0, 0);
  for (unsigned long i = 0; i < 3; ++i) {
    Float64 value = 0;
    if (item.findAndGetFloat64(tag, value, first + i).good()) vector[static_cast<Eigen::Index>(i)] = value;
  }
  return vector;
}

std::vector<fs::path> files_of(const fs::path& study) {
  std::vector<fs::path> files;
  if (fs::is_regular_file(study)) return {study};
  for (auto entry = fs::recursive_directory_iterator(study, fs::directory_options::skip_permission_denied);
       entry != fs::recursive_directory_iterator() && files.size() < most_files; ++entry) {
    if (entry.depth() > 16) entry.disable_recursion_pending();
    if (entry->is_regular_file()) files.push_back(entry->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

void quiet_dicom_library() { OFLog::configure(OFLogger::OFF_LOG_LEVEL); }

SourceStudy::SourceStudy() : header_(std::make_unique<DcmItem>()) {}
SourceStudy::SourceStudy(SourceStudy&&) noexcept = default;
SourceStudy& SourceStudy::operator=(SourceStudy&&) noexcept = default;
SourceStudy::~SourceStudy() = default;

SourceStudy SourceStudy::read(const fs::path& study, const Json& case_json) {
  SourceStudy source;
  std::set<std::string> used;
  for (const auto& stack : case_json.value("stacks", Json::array()))
    if (stack.value("used", true)) used.insert(stack.value("uid", std::string()));
  std::vector<SourceImage> named;
  for (const auto& file : files_of(study)) {
    DcmFileFormat format;
    if (format
            .loadFileUntilTag(file.c_str(), EXS_Unknown, EGL_noChange, DCM_MaxReadLength, ERM_autoDetect,
                              DCM_PixelData)
            .bad())
      continue;
    DcmDataset& dataset = *format.getDataset();
    if (text_of(dataset, DCM_Modality) != "MR") continue;
    SourceImage image;
    image.sop_class_uid = text_of(dataset, DCM_SOPClassUID);
    image.sop_instance_uid = text_of(dataset, DCM_SOPInstanceUID);
    image.series_uid = text_of(dataset, DCM_SeriesInstanceUID);
    image.frame_of_reference_uid = text_of(dataset, DCM_FrameOfReferenceUID);
    image.position_lps = vector_of(dataset, DCM_ImagePositionPatient, 0);
    image.normal = vector_of(dataset, DCM_ImageOrientationPatient, 0)
                       .cross(vector_of(dataset, DCM_ImageOrientationPatient, 3));
    if (image.sop_instance_uid.empty() || image.series_uid.empty()) continue;
    const bool is_named = used.count(image.series_uid) > 0;
    if (source.images_.empty() || (is_named && named.empty())) {
      source.header_->clear();
      for (const auto& tag : study_tags()) dataset.findAndInsertCopyOfElement(tag, source.header_.get());
    }
    source.images_.push_back(image);
    if (is_named) named.push_back(image);
  }
  if (source.images_.empty())
    throw input_error("the study " + study.string() + " holds no MR image", "give the study with --study");
  if (!named.empty()) source.images_ = named;
  std::sort(source.images_.begin(), source.images_.end(), [](const SourceImage& a, const SourceImage& b) {
    return std::tie(a.series_uid, a.sop_instance_uid) < std::tie(b.series_uid, b.sop_instance_uid);
  });
  complete(*source.header_);
  return source;
}

SourceStudy SourceStudy::pseudonymous(const std::string& subject, const std::string& study_date) {
  SourceStudy source;
  std::string date;
  for (const char c : study_date)
    if (c >= '0' && c <= '9') date += c;
  source.header_->putAndInsertString(DCM_SpecificCharacterSet, "ISO_IR 192");
  source.header_->putAndInsertString(DCM_PatientName, dicom_text(subject, 60).c_str());
  source.header_->putAndInsertString(DCM_PatientID, dicom_text(subject, 60).c_str());
  source.header_->putAndInsertString(DCM_StudyDate, date.c_str());
  source.header_->putAndInsertString(DCM_StudyInstanceUID, stable_uid("study of " + subject + date).c_str());
  complete(*source.header_);
  return source;
}

std::string SourceStudy::text(unsigned short group, unsigned short element) const {
  return text_of(*header_, DcmTagKey(group, element));
}

std::string SourceStudy::study_uid() const { return text(0x0020, 0x000d); }
std::string SourceStudy::date() const {
  const std::string date = text(0x0008, 0x0020);
  return date.size() == 8 ? date : "20000101";
}
std::string SourceStudy::time() const {
  const std::string time = text(0x0008, 0x0030);
  return time.empty() ? "000000" : time;
}

std::string SourceStudy::identity() const {
  DcmItem copy(*header_);
  copy.convertToUTF8();
  OFString name;
  DcmPersonName::getFormattedNameFromString(text_of(copy, DCM_PatientName).c_str(), name);
  const std::string born = text_of(copy, DCM_PatientBirthDate);
  std::string identity = name.c_str();
  if (born.size() == 8)
    identity += ", born " + born.substr(0, 4) + "-" + born.substr(4, 2) + "-" + born.substr(6, 2);
  return identity;
}

std::string SourceStudy::patient_id() const { return text(0x0010, 0x0020); }
std::string SourceStudy::birth_date() const { return text(0x0010, 0x0030); }

std::string SourceStudy::fingerprint() const {
  std::string all;
  for (const auto& image : images_) all += image.sop_instance_uid + "\n";
  for (const auto& tag : study_tags()) all += text_of(*header_, tag) + "\n";
  return sha256_of(all);
}

}  // namespace emmetrope::report
