#include "pipeline/pacs/archive.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcspchrs.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/dcmtrans.h>
#include <dcmtk/dcmnet/scu.h>
#include <dcmtk/dcmtls/tlsscu.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <optional>
#include <set>

#include "pipeline/base/clean_text.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/log.hpp"

namespace emmetrope::pacs {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 3> mr_classes{UID_MRImageStorage, UID_EnhancedMRImageStorage,
                                                UID_LegacyConvertedEnhancedMRImageStorage};

/// What an image may be stored in.
constexpr std::array<const char*, 12> image_syntaxes{UID_LittleEndianExplicitTransferSyntax,
                                                     UID_LittleEndianImplicitTransferSyntax,
                                                     UID_DeflatedExplicitVRLittleEndianTransferSyntax,
                                                     UID_JPEGProcess1TransferSyntax,
                                                     UID_JPEGProcess2_4TransferSyntax,
                                                     UID_JPEGProcess14TransferSyntax,
                                                     UID_JPEGProcess14SV1TransferSyntax,
                                                     UID_JPEGLSLosslessTransferSyntax,
                                                     UID_JPEGLSLossyTransferSyntax,
                                                     UID_JPEG2000LosslessOnlyTransferSyntax,
                                                     UID_JPEG2000TransferSyntax,
                                                     UID_RLELosslessTransferSyntax};

/// In UTF-8, from the data set's character set.
std::string text_of(DcmDataset& set, const DcmTagKey& tag) {
  OFString text, utf8;
  if (set.findAndGetOFStringArray(tag, text).bad()) return {};
  DcmSpecificCharacterSet converter;
  if (converter.selectCharacterSet(set).good() && converter.convertString(text, utf8, "\\^=").good())
    text = utf8;
  return clean_utf8(std::string(text.c_str(), text.size()));
}

/// \param asked  YYYYMMDD or a range of two, of which one may be open; empty: any
bool is_date_of(const std::string& date, const std::string& asked) {
  if (date.empty() || asked.empty()) return true;
  const auto dash = asked.find('-');
  if (dash == std::string::npos) return date == asked;
  const std::string first = asked.substr(0, dash), last = asked.substr(dash + 1);
  return date >= first && (last.empty() || date <= last);
}

/// What is not told is no contradiction.
bool is_accession_of(const std::string& number, const std::string& asked) {
  return number.empty() || asked.empty() || number == asked;
}

/// C-GET asks by UIDs alone, under which an archive may hold two patients.
std::optional<Error> other_than(const StudyQuery& asked, DcmDataset& image) {
  const std::string sent = "with study " + asked.study_uid + " the archive sent an image ";
  const std::string study_uid = text_of(image, DCM_StudyInstanceUID);
  if (study_uid.empty())
    return input_error(sent + "without (0020,000d) StudyInstanceUID, or an empty data set",
                       "let the archive's keeper repair it, or export the images as files");
  if (study_uid != asked.study_uid || text_of(image, DCM_PatientID) != asked.patient_id)
    return input_error(sent + "of another patient or study", shared_uid_remedy);
  for (const auto& [is_it, tag] :
       {std::pair{is_accession_of(text_of(image, DCM_AccessionNumber), asked.accession_number),
                  "(0008,0050) AccessionNumber"},
        std::pair{is_date_of(text_of(image, DCM_StudyDate), asked.study_date), "(0008,0020) StudyDate"}})
    if (!is_it)
      return input_error(fmt::format("{}whose {} is not what was asked for", sent, tag),
                         "where it is the study that is meant, ask for it by --study-uid alone");
  return std::nullopt;
}

/// Keeps what arrives under numbers: the names that an archive gives are its own words.
template <class Scu>
class Receiver : public Scu {
 public:
  StudyQuery asked;
  bool patient_is_known = false;  ///< else the first image tells
  fs::path folder;
  std::function<void()> received;
  std::size_t count = 0;
  std::set<std::string> images;  ///< SOPInstanceUIDs
  bool disk_is_full = false;
  std::optional<Error> other;  ///< of the first image that was not asked for

  OFCondition handleSTORERequestFile(T_ASC_PresentationContextID* context, const OFString&,
                                     T_DIMSE_C_StoreRQ* request) override {
    const fs::path file = folder / fmt::format("{:05}.dcm", count + 1);
    const OFCondition result = Scu::handleSTORERequestFile(context, file.c_str(), request);
    if (result.good()) {
      ++count;
      look_at(file, request->AffectedSOPInstanceUID);
      received();
    } else if (!std::ofstream(file).write(std::string(4096, ' ').data(), 4096).flush()) {
      disk_is_full = true;
    }
    return result;
  }

 private:
  /// A file that cannot be read is judged by who reads it.
  void look_at(const fs::path& file, const std::string& told_uid) {
    DcmFileFormat image;
    if (image.loadFile(file.c_str()).bad()) {
      images.insert(told_uid);
      return;
    }
    DcmDataset& set = *image.getDataset();
    if (!patient_is_known) asked.patient_id = text_of(set, DCM_PatientID);
    patient_is_known = true;
    if (!other) other = other_than(asked, set);
    images.insert(text_of(set, DCM_SOPInstanceUID));
  }
};

/// One association, with TLS or without, and everything that may go wrong said once.
template <class Scu>
class Association {
 public:
  Association(const ArchiveSettings& settings, ExitStatus status) : settings_(settings), status_(status) {
    scu_.setPeerHostName(settings.host.c_str());
    scu_.setPeerPort(settings.port);
    scu_.setPeerAETitle(settings.called_ae_title.c_str());
    scu_.setAETitle(settings.calling_ae_title.c_str());
    scu_.setACSETimeout(static_cast<Uint32>(settings.timeout_s));
    scu_.setConnectionTimeout(settings.timeout_s);
    scu_.setDIMSEBlockingMode(DIMSE_NONBLOCKING);
    scu_.setDIMSETimeout(static_cast<Uint32>(settings.timeout_s));
    // Of what is begun and not ended; of the library, for every connection from now on.
    dcmSocketReceiveTimeout.set(settings.timeout_s);
    dcmSocketSendTimeout.set(settings.timeout_s);
  }
  ~Association() {
    if (!scu_.isConnected()) return;
    if (scu_.releaseAssociation().bad()) scu_.abortAssociation();
  }
  Association(const Association&) = delete;
  Association& operator=(const Association&) = delete;

  Receiver<Scu>& scu() { return scu_; }
  void offer(const char* sop_class, const OFList<OFString>& syntaxes,
             T_ASC_SC_ROLE role = ASC_SC_ROLE_DEFAULT) {
    require(scu_.addPresentationContext(sop_class, syntaxes, role), "cannot be asked");
  }
  void open() {
    require(scu_.initNetwork(), "cannot be reached");
    require(scu_.negotiateAssociation(), "opens no association");
  }
  T_ASC_PresentationContextID context(const char* sop_class, const std::string& service) {
    const T_ASC_PresentationContextID id = scu_.findPresentationContextID(sop_class, "");
    if (id == 0) fail("does not offer " + service);
    return id;
  }
  void require(const OFCondition& result, const std::string& otherwise) const {
    if (result.bad()) fail(otherwise + ": " + result.text());
  }
  [[noreturn]] void fail(const std::string& why) const {
    throw Error(status_,
                fmt::format("the archive {} at {}:{} {}", settings_.called_ae_title, settings_.host,
                            settings_.port, clean_utf8(why)),
                "check host, port and names in the settings, and that the archive knows \"" +
                    settings_.calling_ae_title + "\"");
  }

 private:
  const ArchiveSettings& settings_;
  ExitStatus status_;
  Receiver<Scu> scu_;
};

void add_tls(DcmTLSSCU& scu, const TlsFiles& tls) {
  scu.setPeerCertVerification(DCV_requireCertificate);
  scu.addTrustedCertFile(tls.authority.c_str());
  if (!tls.certificate.empty()) scu.enableAuthentication(tls.key.c_str(), tls.certificate.c_str(), nullptr);
}

/// Calls `work` with an association that is set up but not open yet.
template <class Work>
auto with_association(const ArchiveSettings& settings, ExitStatus status, const Work& work) {
  if (!settings.tls) {
    Association<DcmSCU> association(settings, status);
    return work(association);
  }
  Association<DcmTLSSCU> association(settings, status);
  add_tls(association.scu(), *settings.tls);
  return work(association);
}

const OFList<OFString>& plain_syntaxes() {
  static const OFList<OFString> list = [] {
    OFList<OFString> syntaxes;
    syntaxes.push_back(UID_LittleEndianExplicitTransferSyntax);
    syntaxes.push_back(UID_LittleEndianImplicitTransferSyntax);
    return syntaxes;
  }();
  return list;
}

/// C-FIND in an association that is open.
template <class Scu>
std::vector<std::map<std::string, std::string>> found(Association<Scu>& association, DcmDataset& query,
                                                      const std::map<std::string, DcmTagKey>& wanted) {
  for (const auto& [name, tag] : wanted)
    if (!query.tagExists(tag)) query.insertEmptyElement(tag);
  OFList<QRResponse*> responses;
  const auto id = association.context(UID_FINDStudyRootQueryRetrieveInformationModel, "C-FIND");
  const OFCondition result = association.scu().sendFINDRequest(id, &query, &responses);
  std::vector<std::map<std::string, std::string>> rows;
  Uint16 last = 0;
  for (QRResponse* response : responses) {
    last = response->m_status;
    if (response->m_dataset != nullptr) {
      std::map<std::string, std::string>& row = rows.emplace_back();
      for (const auto& [name, tag] : wanted) row[name] = text_of(*response->m_dataset, tag);
    }
    delete response;
  }
  association.require(result, "did not answer a query");
  if (last != STATUS_Success) association.fail(fmt::format("refused a query with status {:04x}", last));
  return rows;
}

/// Beside images a series of Modality MR may hold spectra, raw data and objects of the vendor's own. An archive that does
/// not tell the class is believed.
bool is_image(const std::string& sop_class) {
  return sop_class.empty() || std::find(mr_classes.begin(), mr_classes.end(), sop_class) != mr_classes.end();
}

/// Of the warnings of C-STORE (PS3.4 B.2.3).
const char* meaning_of(Uint16 status) {
  switch (status) {
    case STATUS_STORE_Warning_CoercionOfDataElements:
      return "it changed some of its values";
    case STATUS_STORE_Warning_ElementsDiscarded:
      return "it left some of its values out";
    case STATUS_STORE_Warning_DataSetDoesNotMatchSOPClass:
      return "it holds it for no object of its class";
    default:
      return "a warning of its own";
  }
}

/// UIDs have at most 64 characters; an identifier of some kB every archive takes.
constexpr std::size_t images_a_request = 100;

bool is_ascii(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char letter) { return letter < 0x80; });
}

void put(DcmDataset& set, const DcmTagKey& tag, const std::string& value) {
  if (!value.empty()) set.putAndInsertString(tag, value.c_str());
}

}  // namespace

Archive::Archive(ArchiveSettings settings) : settings_(std::move(settings)) {
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);  // it would name patients
}

std::vector<FoundStudy> Archive::find_studies(const StudyQuery& query) const {
  return with_association(settings_, ExitStatus::input_invalid, [&](auto& association) {
    association.offer(UID_FINDStudyRootQueryRetrieveInformationModel, plain_syntaxes());
    association.open();
    DcmDataset keys;
    put(keys, DCM_QueryRetrieveLevel, "STUDY");
    put(keys, DCM_StudyInstanceUID, query.study_uid);
    put(keys, DCM_PatientID, query.patient_id);
    put(keys, DCM_AccessionNumber, query.accession_number);
    put(keys, DCM_StudyDate, query.study_date);
    for (const std::string& text : {query.patient_id, query.accession_number})
      if (!is_ascii(text)) put(keys, DCM_SpecificCharacterSet, "ISO_IR 192");
    std::vector<FoundStudy> studies;
    for (auto& row : found(association, keys,
                           {{"uid", DCM_StudyInstanceUID},
                            {"date", DCM_StudyDate},
                            {"description", DCM_StudyDescription},
                            {"modalities", DCM_ModalitiesInStudy},
                            {"accession", DCM_AccessionNumber},
                            {"patient", DCM_PatientID}}))
      if (is_accession_of(row["accession"], query.accession_number) &&
          is_date_of(row["date"], query.study_date))
        studies.push_back({row["uid"], row["date"], row["description"], row["modalities"], row["accession"],
                           row["patient"]});
    std::sort(studies.begin(), studies.end(), [](const FoundStudy& a, const FoundStudy& b) {
      return std::tie(a.date, a.uid) < std::tie(b.date, b.uid);
    });
    return studies;
  });
}

std::vector<FoundSeries> Archive::find_mr_series(const std::string& study_uid) const {
  return with_association(settings_, ExitStatus::input_invalid, [&](auto& association) {
    association.offer(UID_FINDStudyRootQueryRetrieveInformationModel, plain_syntaxes());
    association.open();
    DcmDataset keys;
    put(keys, DCM_QueryRetrieveLevel, "SERIES");
    put(keys, DCM_StudyInstanceUID, study_uid);
    put(keys, DCM_Modality, "MR");
    std::vector<FoundSeries> series;
    for (auto& row : found(association, keys, {{"uid", DCM_SeriesInstanceUID}, {"modality", DCM_Modality}})) {
      if (row["modality"] != "MR") continue;
      DcmDataset images;
      put(images, DCM_QueryRetrieveLevel, "IMAGE");
      put(images, DCM_StudyInstanceUID, study_uid);
      put(images, DCM_SeriesInstanceUID, row["uid"]);
      FoundSeries one{row["uid"], {}};
      for (auto& image :
           found(association, images, {{"uid", DCM_SOPInstanceUID}, {"class", DCM_SOPClassUID}}))
        if (is_image(image["class"])) one.images.push_back(image["uid"]);
      if (!one.images.empty()) series.push_back(std::move(one));
    }
    return series;
  });
}

std::size_t Archive::get(const StudyQuery& asked, const std::vector<FoundSeries>& series,
                         const fs::path& folder, const std::function<void()>& received) const {
  return with_association(settings_, ExitStatus::input_invalid, [&](auto& association) {
    association.offer(UID_GETStudyRootQueryRetrieveInformationModel, plain_syntaxes());
    // One context a syntax, so that the archive can choose the one that it has the image in.
    for (const char* sop_class : mr_classes)
      for (const char* syntax : image_syntaxes) {
        OFList<OFString> one;
        one.push_back(syntax);
        association.offer(sop_class, one, ASC_SC_ROLE_SCP);
      }
    association.open();
    auto& scu = association.scu();
    scu.setStorageMode(DCMSCU_STORAGE_BIT_PRESERVING);
    scu.setStorageDir(folder.c_str());
    scu.asked = asked;
    scu.patient_is_known = !asked.patient_id.empty();
    scu.folder = folder;
    scu.received = received;
    const auto id = association.context(UID_GETStudyRootQueryRetrieveInformationModel, "C-GET");
    for (const FoundSeries& one : series) {
      const std::size_t before = scu.count;
      scu.images.clear();
      Uint16 last = STATUS_Success;
      for (std::size_t from = 0; from < one.images.size() && last == STATUS_Success;
           from += images_a_request) {
        DcmDataset keys;
        put(keys, DCM_QueryRetrieveLevel, "IMAGE");
        put(keys, DCM_StudyInstanceUID, asked.study_uid);
        put(keys, DCM_SeriesInstanceUID, one.uid);
        const auto begin = one.images.begin() + static_cast<std::ptrdiff_t>(from);
        const auto end = one.images.begin() +
                         static_cast<std::ptrdiff_t>(std::min(from + images_a_request, one.images.size()));
        put(keys, DCM_SOPInstanceUID, fmt::format("{}", fmt::join(begin, end, "\\")));
        OFList<RetrieveResponse*> responses;
        const OFCondition result = scu.sendCGETRequest(id, &keys, &responses);
        for (RetrieveResponse* response : responses) {
          last = response->m_status;
          delete response;
        }
        if (scu.disk_is_full)
          throw output_error("cannot write into " + folder.string(), "make room on the disk");
        if (scu.other) throw *scu.other;
        association.require(result, "did not send a series");
      }
      if (last != STATUS_Success || scu.count - before < one.images.size())
        association.fail(fmt::format("sent {} of {} images of a series, and status {:04x}",
                                     scu.count - before, one.images.size(), last));
      if (scu.images != std::set<std::string>(one.images.begin(), one.images.end()))
        throw input_error(
            fmt::format("of series {} the archive sent other images than it has by its own list, by "
                        "(0008,0018) SOPInstanceUID",
                        one.uid),
            "pull again; where that does not help, let the archive's keeper export the study as files");
    }
    return scu.count;
  });
}

void Archive::store(const std::vector<fs::path>& files, const std::function<void()>& sent) const {
  with_association(settings_, ExitStatus::not_writable, [&](auto& association) {
    std::set<std::pair<std::string, std::string>> offered;
    for (const fs::path& file : files) {
      DcmMetaInfo header;
      OFString sop_class, syntax;
      association.require(header.loadFile(file.c_str()), file.string() + " is not read");
      header.findAndGetOFString(DCM_MediaStorageSOPClassUID, sop_class);
      header.findAndGetOFString(DCM_TransferSyntaxUID, syntax);
      if (!offered.emplace(sop_class.c_str(), syntax.c_str()).second) continue;
      OFList<OFString> syntaxes;
      syntaxes.push_back(syntax);
      association.offer(sop_class.c_str(), syntaxes);
    }
    association.open();
    for (std::size_t i = 0; i < files.size(); ++i) {
      const std::string name = files[i].filename().string();
      const std::string which =
          fmt::format("{} (before it {} of {} objects were sent)", name, i, files.size());
      Uint16 status = 0;
      const OFCondition result = association.scu().sendSTORERequest(0, files[i].c_str(), nullptr, status);
      association.require(result, "did not take " + which);
      const bool is_kept = status == STATUS_Success || (status & 0xf000) == 0xb000;  // with a warning
      if (!is_kept) association.fail(fmt::format("refused {} with status {:04x}", which, status));
      if (status != STATUS_Success)
        spdlog::warn("the archive took {} with status {:04x}: {}", name, status, meaning_of(status));
      sent();
    }
  });
}

}  // namespace emmetrope::pacs
