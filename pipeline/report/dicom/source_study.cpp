#include "pipeline/report/dicom/source_study.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/iso_date.hpp"
#include "pipeline/report/dicom/object.hpp"
#include "segmentation/intake/decoder.hpp"
#include "segmentation/intake/file_list.hpp"
#include "segmentation/intake/tag_values.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

namespace tag = segmentation::tag;
using segmentation::ImageHeader;

/// What an object of the same study must repeat, so that an archive files it with its patient.
constexpr std::array study_tags{tag::patient_name,
                                tag::patient_id,
                                tag::issuer_of_patient_id,
                                tag::patient_birth_date,
                                tag::patient_birth_time,
                                tag::patient_sex,
                                tag::other_patient_names,
                                tag::ethnic_group,
                                tag::patient_comments,
                                tag::identity_removed,
                                tag::deidentification_method,
                                tag::patient_age,
                                tag::patient_size,
                                tag::patient_weight,
                                tag::study_instance,
                                tag::study_date,
                                tag::study_time,
                                tag::referring_physician,
                                tag::study_id,
                                tag::accession_number,
                                tag::study_description};

DcmTagKey key(const segmentation::Tag& tag) { return {tag.group, tag.element}; }

std::string text_of(DcmItem& item, const DcmTagKey& tag) {
  OFString value;
  return item.findAndGetOFStringArray(tag, value).good() ? std::string(value.c_str()) : std::string();
}

/// Type 2 attributes: present even where the source has none.
void complete(DcmItem& header) {
  for (const auto& tag : {DCM_PatientName, DCM_PatientID, DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyDate,
                          DCM_StudyTime, DCM_ReferringPhysicianName, DCM_StudyID, DCM_AccessionNumber})
    if (!header.tagExists(tag)) header.insertEmptyElement(tag);
  // Type 1C: how, where identity was removed; a source may have told it by codes alone.
  if (text_of(header, DCM_PatientIdentityRemoved) == "YES" &&
      text_of(header, DCM_DeidentificationMethod).empty())
    header.putAndInsertString(DCM_DeidentificationMethod, "by the source of the images");
}

/// \param first  number of the attribute's values
Eigen::Vector3d vector_of(const ImageHeader& header, const segmentation::Tag& tag, std::size_t count,
                          std::size_t first) {
  const auto numbers = segmentation::parse_numbers(header.value(tag), count);
  return numbers ? Eigen::Vector3d(numbers->data() + first) : Eigen::Vector3d(0, 0, 0);
}

/// Of several frames each has its own place: none is told here.
SourceImage image_of(const ImageHeader& header) {
  SourceImage image{header.value(tag::sop_class), header.value(tag::sop_instance),
                    header.value(tag::series_instance), header.value(tag::frame_of_reference)};
  if (header.frames.size() > 1) return image;
  image.position_lps = vector_of(header, tag::image_position, 3, 0);
  image.normal =
      vector_of(header, tag::image_orientation, 6, 0).cross(vector_of(header, tag::image_orientation, 6, 3));
  return image;
}

bool is_unreadable(const ImageHeader& header, const segmentation::Tag& tag) {
  return header.unreadable.count(tag.keyword) > 0;
}

std::string why_unreadable(const std::string& tags) {
  return fmt::format("{}: not in the character set {}, or in one that cannot be converted", tags,
                     to_string(tag::character_set));
}

/// What is wrong with a date or a time, which objects could not be written with; empty where nothing is.
std::string oddity_of(const ImageHeader& header, const segmentation::Tag& tag) {
  const std::string& value = header.value(tag);
  const DcmEVR representation = DcmTag(key(tag)).getEVR();
  const bool is_odd = (representation == EVR_DA && iso_date(value).empty()) ||
                      (representation == EVR_TM && DcmTime::checkStringValue(value.c_str(), "1").bad());
  if (value.empty() || !is_odd) return {};
  constexpr unsigned short group_of_patient = 0x0010;
  return fmt::format("{} is no {}{}: it is taken as unknown", to_string(tag),
                     representation == EVR_DA ? "date" : "time",
                     tag.group == group_of_patient ? "" : ", but " + segmentation::in_quotes(value));
}

/// Of attributes that an object cannot repeat; what those of the patient hold is not told.
std::vector<std::string> warnings_of(const ImageHeader& header) {
  std::vector<std::string> tags, warnings;
  for (const auto& tag : study_tags) {
    if (is_unreadable(header, tag)) tags.push_back(to_string(tag));
    if (const std::string oddity = oddity_of(header, tag); !oddity.empty()) warnings.push_back(oddity);
  }
  if (!tags.empty())
    warnings.push_back(why_unreadable(fmt::format("{}", fmt::join(tags, ", "))) +
                       "; the DICOM objects are without it");
  return warnings;
}

/// The files below a folder that segmentation read, each once.
std::vector<fs::path> files_read(const fs::path& study, std::set<std::string> sha256) {
  const segmentation::FileList list = segmentation::list_files(study, {});
  std::vector<fs::path> files;
  for (const fs::path& file : list.files) {
    if (sha256.empty()) break;
    const bool is_noted =
        !segmentation::is_nifti_name(file) && sha256.erase(sha256_of_file(list.root / file)) > 0;
    if (is_noted) files.push_back(list.root / file);
  }
  return files;
}

}  // namespace

void quiet_dicom_library() { OFLog::configure(OFLogger::OFF_LOG_LEVEL); }

SourceStudy::SourceStudy() : header_(std::make_unique<DcmItem>()) {}
SourceStudy::SourceStudy(SourceStudy&&) noexcept = default;
SourceStudy& SourceStudy::operator=(SourceStudy&&) noexcept = default;
SourceStudy::~SourceStudy() = default;

NotedStudy noted_study(const Json& case_json, const Json& stage_json) {
  NotedStudy noted;
  const Json inputs = stage_json.value("inputs", Json::object());
  for (const auto& [input, sha256] : inputs.items())
    if (input.rfind("study/", 0) == 0) noted.sha256.insert(sha256.get<std::string>());
  const Json stacks = case_json.value("stacks", Json::array());
  const auto is_nifti = [](const Json& json) {
    return json.value("uid", std::string()).rfind("nifti-", 0) == 0;
  };
  // Nothing tells whose a NIfTI volume is: what was made of one belongs to no patient's study.
  if (std::any_of(stacks.begin(), stacks.end(), is_nifti)) return noted;
  std::map<std::string, std::size_t> files;  // of DICOM series
  for (const Json& series : case_json.value("series", Json::array()))
    if (!is_nifti(series)) files[series.value("uid", std::string())] = series.value("files", std::size_t{0});
  // Where no eye was seen no stack was used: all that were searched are the study.
  for (const bool only_used : {true, false}) {
    for (const Json& stack : stacks)
      if (const auto series = files.find(stack.value("uid", std::string()));
          series != files.end() && (stack.value("used", true) || !only_used))
        noted.files_of_used.insert(*series);
    if (!noted.files_of_used.empty()) break;
  }
  return noted;
}

SourceStudy SourceStudy::read(const fs::path& study, const NotedStudy& noted) {
  SourceStudy source;
  std::map<std::string, std::size_t> found;
  segmentation::Decoder decoder{segmentation::IntakeLimits{}};
  for (const fs::path& file : files_read(study, noted.sha256)) {
    const ImageHeader header = decoder.header(file);
    const SourceImage image = image_of(header);
    if (noted.files_of_used.count(image.series_uid) == 0 || image.sop_instance_uid.empty()) continue;
    ++found[image.series_uid];
    if (source.images_.empty()) {
      if (noted.sha256.count(sha256_of_file(file)) == 0)
        throw input_error(file.string() + " was changed while it was read", "run it again");
      if (!header.has(tag::study_instance))
        throw input_error(fmt::format("{}: {} is absent: no object can belong to its study", file.string(),
                                      to_string(tag::study_instance)),
                          "without --study the objects carry the pseudonym");
      if (is_unreadable(header, tag::patient_id))
        throw input_error(fmt::format("{}: {}: no object can belong to its patient", file.string(),
                                      why_unreadable(to_string(tag::patient_id))),
                          "without --study the objects carry the pseudonym");
      source.warnings_ = warnings_of(header);
      source.header_->putAndInsertString(DCM_SpecificCharacterSet, "ISO_IR 192");
      for (const auto& tag : study_tags)
        if (header.has(tag) && oddity_of(header, tag).empty())
          source.header_->putAndInsertString(key(tag), header.value(tag).c_str());
    }
    source.images_.push_back(image);
  }
  for (const auto& [series, files] : noted.files_of_used)
    if (found[series] == 0 || found[series] < files)
      throw input_error(
          fmt::format("{} is not the study that the case was made from: of the {} files of its series "
                      "{}, {} are there as they were",
                      study.string(), files, series, found[series]),
          "give that study with --study, or run the case again: emmetrope run STUDY -o CASE");
  if (source.images_.empty())
    throw input_error(study.string() +
                          " is not the study that the case was made from: the case names no DICOM "
                          "series, or NIfTI volumes beside them, which name no patient",
                      "without --study the objects carry the pseudonym");
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
  const std::string name = dicom_text(subject, most_patient_id);
  source.header_->putAndInsertString(DCM_PatientName, name.c_str());
  source.header_->putAndInsertString(DCM_PatientID, name.c_str());
  source.header_->putAndInsertString(DCM_StudyDate, date.c_str());
  source.header_->putAndInsertString(DCM_StudyInstanceUID, stable_uid("study of " + subject + date).c_str());
  complete(*source.header_);
  return source;
}

SourceStudy SourceStudy::deidentified(const Deidentified& header) {
  SourceStudy source = pseudonymous(header.subject, "");
  DcmItem& item = *source.header_;
  item.putAndInsertString(DCM_StudyInstanceUID,
                          stable_uid("deidentified study of " + header.subject + " " + header.study).c_str());
  item.putAndInsertString(DCM_PatientIdentityRemoved, "YES");
  item.putAndInsertString(DCM_DeidentificationMethod, "Emmetrope: PS3.15 Basic Profile");
  item.putAndInsertString(DCM_LongitudinalTemporalInformationModified, "REMOVED");
  std::vector<std::pair<const char*, const char*>> methods{
      {"113100", "Basic Application Confidentiality Profile"},
      {"113104", "Clean Structured Content Option"},
      {"113105", "Clean Descriptors Option"}};
  if (!header.age.empty() || !header.sex.empty()) {
    methods.emplace_back("113108", "Retain Patient Characteristics Option");
    if (!header.age.empty()) item.putAndInsertString(DCM_PatientAge, header.age.c_str());
    item.putAndInsertString(DCM_PatientSex, header.sex.c_str());
  }
  for (const auto& [code, meaning] : methods) put_code(item, 0x0012, 0x0064, code, "DCM", meaning);
  return source;
}

std::string SourceStudy::text(unsigned short group, unsigned short element) const {
  return text_of(*header_, DcmTagKey(group, element));
}

std::string SourceStudy::study_uid() const { return text(0x0020, 0x000d); }
std::string SourceStudy::known_date() const { return text(0x0008, 0x0020); }
std::string SourceStudy::date() const {
  const std::string date = known_date();
  return date.empty() ? "20000101" : date;
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
  const std::string born = iso_date(text_of(copy, DCM_PatientBirthDate));
  std::string identity = name.c_str();
  if (!born.empty()) identity += (identity.empty() ? "born " : ", born ") + born;
  return identity;
}

std::string SourceStudy::patient_id() const { return text(0x0010, 0x0020); }
std::string SourceStudy::birth_date() const { return text(0x0010, 0x0030); }

std::string SourceStudy::fingerprint() const {
  std::string all;
  for (const auto& image : images_) all += image.sop_instance_uid + "\n";
  for (const auto& tag : study_tags) all += text_of(*header_, key(tag)) + "\n";
  return sha256_of(all);
}

}  // namespace emmetrope::report
