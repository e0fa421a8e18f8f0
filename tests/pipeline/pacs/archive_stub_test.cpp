// Against an archive that does what none should.
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/scp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <thread>

#include "pipeline/base/error.hpp"
#include "pipeline/pacs/archive.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::pacs {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

constexpr const char* study = "1.2.3";
constexpr const char* series = "1.2.3.1";

/// An image of the study that says no more than an archive's client looks at.
DcmDataset image(const std::string& uid) {
  DcmDataset set;
  set.putAndInsertString(DCM_SOPClassUID, UID_MRImageStorage);
  set.putAndInsertString(DCM_SOPInstanceUID, uid.c_str());
  set.putAndInsertString(DCM_StudyDate, "20260314");
  set.putAndInsertString(DCM_AccessionNumber, "A123");
  set.putAndInsertString(DCM_PatientID, "MRN-4711");
  set.putAndInsertString(DCM_StudyInstanceUID, study);
  set.putAndInsertString(DCM_SeriesInstanceUID, series);
  return set;
}

/// Answers every C-FIND with `found` and every C-GET with `images`, whatever was asked for.
class StubArchive : public DcmSCP {
 public:
  std::vector<DcmDataset> found, images;
  Uint16 store_status = STATUS_Success;
  int stored = 0;
  std::string asked_character_set;

  explicit StubArchive(Uint16 port) {
    OFList<OFString> syntaxes;
    syntaxes.push_back(UID_LittleEndianExplicitTransferSyntax);
    for (const char* query :
         {UID_FINDStudyRootQueryRetrieveInformationModel, UID_GETStudyRootQueryRetrieveInformationModel})
      addPresentationContext(query, syntaxes);
    addPresentationContext(UID_MRImageStorage, syntaxes, ASC_SC_ROLE_SCP);  // C-GET
    addPresentationContext(UID_RawDataStorage, syntaxes);                   // C-STORE
    setPort(port);
    setConnectionBlockingMode(DUL_NOBLOCK);
    setConnectionTimeout(1);
    if (openListenPort().bad()) throw std::runtime_error("the port is taken");
    thread_ = std::thread([this] { acceptAssociations(); });
  }
  ~StubArchive() override {
    ends_ = true;
    thread_.join();
  }

 protected:
  OFBool stopAfterCurrentAssociation() override { return ends_; }
  OFBool stopAfterConnectionTimeout() override { return ends_; }
  OFCondition handleIncomingCommand(T_DIMSE_Message* message,
                                    const DcmPresentationContextInfo& context) override {
    switch (message->CommandField) {
      case DIMSE_C_FIND_RQ:
        return find(message->msg.CFindRQ, context.presentationContextID);
      case DIMSE_C_GET_RQ:
        return get(message->msg.CGetRQ, context.presentationContextID);
      case DIMSE_C_STORE_RQ:
        return take(message->msg.CStoreRQ, context.presentationContextID);
      default:
        return EC_IllegalCall;
    }
  }

 private:
  OFCondition find(T_DIMSE_C_FindRQ& request, T_ASC_PresentationContextID id) {
    DcmDataset* query = nullptr;
    receiveFINDRequest(request, id, query);
    OFString text;
    query->findAndGetOFString(DCM_SpecificCharacterSet, text);
    asked_character_set = text.c_str();
    delete query;
    for (DcmDataset& row : found)
      sendFINDResponse(id, request.MessageID, request.AffectedSOPClassUID, &row, STATUS_Pending);
    return sendFINDResponse(id, request.MessageID, request.AffectedSOPClassUID, nullptr, STATUS_Success);
  }
  OFCondition get(T_DIMSE_C_GetRQ& request, T_ASC_PresentationContextID id) {
    DcmDataset* query = nullptr;
    receiveDIMSEDataset(&id, &query);
    delete query;
    // The second that Archive::get offers, after that of C-GET: MR images, explicit little endian.
    constexpr T_ASC_PresentationContextID of_images = 3;
    for (DcmDataset& set : images) {
      T_DIMSE_Message message{};
      message.CommandField = DIMSE_C_STORE_RQ;
      T_DIMSE_C_StoreRQ& store = message.msg.CStoreRQ;
      store.MessageID = 7;
      store.DataSetType = DIMSE_DATASET_PRESENT;
      OFString uid;
      set.findAndGetOFString(DCM_SOPInstanceUID, uid);
      std::strcpy(store.AffectedSOPClassUID, UID_MRImageStorage);
      std::strcpy(store.AffectedSOPInstanceUID, uid.empty() ? "1.2.9" : uid.c_str());
      sendDIMSEMessage(of_images, &message, &set);
      T_ASC_PresentationContextID answered = 0;
      receiveDIMSECommand(&answered, &message, nullptr);
    }
    T_DIMSE_Message message{};
    message.CommandField = DIMSE_C_GET_RSP;
    T_DIMSE_C_GetRSP& response = message.msg.CGetRSP;
    response.MessageIDBeingRespondedTo = request.MessageID;
    response.DimseStatus = STATUS_Success;
    response.DataSetType = DIMSE_DATASET_NULL;
    response.opts = O_GET_AFFECTEDSOPCLASSUID;
    std::strcpy(response.AffectedSOPClassUID, request.AffectedSOPClassUID);
    return sendDIMSEMessage(id, &message, nullptr);
  }
  OFCondition take(T_DIMSE_C_StoreRQ& request, T_ASC_PresentationContextID id) {
    DcmDataset* object = nullptr;
    receiveSTORERequest(request, id, object);
    delete object;
    const bool is_second = ++stored == 2;
    return sendSTOREResponse(id, request, is_second ? store_status : static_cast<Uint16>(STATUS_Success));
  }

  std::atomic<bool> ends_ = false;
  std::thread thread_;
};

class ArchiveStub : public testing::Test {
 protected:
  ArchiveStub() {
    settings_.host = "127.0.0.1";
    settings_.port = port();
    settings_.called_ae_title = "STUB";
    settings_.calling_ae_title = "EMMETROPE";
    settings_.timeout_s = 2;
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  }
  /// A series of the two images "1.2.3.1.1" and "1.2.3.1.2" is asked for and `images` come.
  std::string error_of_get(std::vector<DcmDataset> images, StudyQuery asked = {}) {
    asked.study_uid = study;
    stub_.images = std::move(images);
    const test::TemporaryFolder folder;
    try {
      const std::size_t count =
          Archive(settings_).get(asked, {{series, {"1.2.3.1.1", "1.2.3.1.2"}}}, folder.path(), [] {});
      EXPECT_EQ(count, 2U);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid) << error.what();
      EXPECT_FALSE(error.remedy().empty());
      return error.what();
    }
    return {};
  }
  static std::uint16_t port() { return static_cast<std::uint16_t>(40000 + ::getpid() % 20000); }
  std::vector<fs::path> objects_in(const fs::path& folder) const {
    std::vector<fs::path> files;
    for (const char* name : {"a.dcm", "b.dcm", "c.dcm"}) {
      DcmFileFormat file;
      file.getDataset()->putAndInsertString(DCM_SOPClassUID, UID_RawDataStorage);
      file.getDataset()->putAndInsertString(DCM_SOPInstanceUID,
                                            ("1.2.3.9." + std::to_string(files.size())).c_str());
      files.push_back(folder / name);
      EXPECT_TRUE(file.saveFile(files.back().c_str(), EXS_LittleEndianExplicit).good());
    }
    return files;
  }
  ArchiveSettings settings_;
  StubArchive stub_{port()};
};

TEST_F(ArchiveStub, GivesAllImagesOrNone) {
  EXPECT_EQ(error_of_get({image("1.2.3.1.1"), image("1.2.3.1.2")}), "");
  // As many as were asked for, of which one came twice or is another.
  EXPECT_THAT(error_of_get({image("1.2.3.1.1"), image("1.2.3.1.1")}), HasSubstr("(0008,0018)"));
  EXPECT_THAT(error_of_get({image("1.2.3.1.1"), image("1.2.3.2.1")}), HasSubstr("(0008,0018)"));
  EXPECT_THAT(error_of_get({image("1.2.3.1.1")}), HasSubstr("1 of 2 images"));
}

TEST_F(ArchiveStub, GivesImagesOfWhatWasAskedFor) {
  const auto asked = [](const std::string& accession, const std::string& date) {
    StudyQuery query;
    query.accession_number = accession;
    query.study_date = date;
    return query;
  };
  const std::vector<DcmDataset> both{image("1.2.3.1.1"), image("1.2.3.1.2")};
  for (const char* date : {"", "20260314", "20260301-20260331", "20260314-", "-20260314"})
    EXPECT_EQ(error_of_get(both, asked("A123", date)), "") << date;
  EXPECT_THAT(error_of_get(both, asked("A124", "")), HasSubstr("(0008,0050)"));
  for (const char* date : {"20260313", "20260315-20260331", "20260315-", "-20260313"})
    EXPECT_THAT(error_of_get(both, asked("", date)), HasSubstr("(0008,0020)")) << date;
  DcmDataset of_no_study;  // an empty one cannot be sent by DCMTK
  of_no_study.putAndInsertString(DCM_SOPClassUID, UID_MRImageStorage);
  EXPECT_THAT(error_of_get({image("1.2.3.1.1"), of_no_study}), HasSubstr("(0020,000d)"));
}

/// In whatever character set the images have it.
TEST_F(ArchiveStub, ComparesIdentifiersBeyondAscii) {
  std::vector<DcmDataset> both{image("1.2.3.1.1"), image("1.2.3.1.2")};
  for (DcmDataset& set : both) {
    set.putAndInsertString(DCM_SpecificCharacterSet, "ISO_IR 100");
    set.putAndInsertString(DCM_PatientID, "M\xFC-1");
  }
  StudyQuery query;
  query.patient_id = "M\xC3\xBC-1";
  EXPECT_EQ(error_of_get(both, query), "");
  query.patient_id = "M\xC3\xB6-1";
  EXPECT_THAT(error_of_get(both, query), HasSubstr("another patient"));

  Archive(settings_).find_studies(query);
  EXPECT_EQ(stub_.asked_character_set, "ISO_IR 192");
  query.patient_id = "MRN-4711";
  Archive(settings_).find_studies(query);
  EXPECT_EQ(stub_.asked_character_set, "");
}

TEST_F(ArchiveStub, StudiesOfAnotherAccessionNumberOrDateAreNotFound) {
  stub_.found = {image("1.2.3.1.1")};
  StudyQuery query;
  query.accession_number = "A123";
  query.study_date = "20260314";
  ASSERT_EQ(Archive(settings_).find_studies(query).size(), 1U);
  query.accession_number = "A124";
  EXPECT_TRUE(Archive(settings_).find_studies(query).empty());
  query.accession_number = "A123";
  query.study_date = "20250101-20251231";
  EXPECT_TRUE(Archive(settings_).find_studies(query).empty());
}

TEST_F(ArchiveStub, WhatItTookWithAWarningIsSaid) {
  const test::TemporaryFolder folder;
  const std::vector<fs::path> files = objects_in(folder.path());
  for (const Uint16 status :
       {STATUS_STORE_Warning_CoercionOfDataElements, STATUS_STORE_Warning_ElementsDiscarded,
        STATUS_STORE_Warning_DataSetDoesNotMatchSOPClass}) {
    stub_.store_status = status;
    stub_.stored = 0;
    testing::internal::CaptureStdout();  // where the tests' logger writes
    Archive(settings_).store(files, [] {});
    const std::string said = testing::internal::GetCapturedStdout();
    EXPECT_THAT(said, HasSubstr("b.dcm with status b00"));
    EXPECT_THAT(said, Not(HasSubstr("a.dcm")));
  }
}

TEST_F(ArchiveStub, SaysHowManyObjectsWereSentBeforeOneWasRefused) {
  const test::TemporaryFolder folder;
  stub_.store_status = 0xa700;
  try {
    Archive(settings_).store(objects_in(folder.path()), [] {});
    ADD_FAILURE() << "one was refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::not_writable);
    EXPECT_THAT(error.what(), HasSubstr("b.dcm (before it 1 of 3 objects were sent) with status a700"));
  }
}

/// The beginning of a message, and nothing more.
TEST_F(ArchiveStub, ThatStopsWithinAMessageIsLeft) {
  const int listening = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  settings_.port = static_cast<std::uint16_t>(port() + 1);
  address.sin_port = htons(settings_.port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int again = 1;
  ::setsockopt(listening, SOL_SOCKET, SO_REUSEADDR, &again, sizeof again);
  ASSERT_EQ(::bind(listening, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(::listen(listening, 1), 0);
  std::thread archive([&] {
    const int connection = ::accept(listening, nullptr, nullptr);
    constexpr std::array<unsigned char, 6> accepts_16_kB{2, 0, 0, 0, 0x40, 0};
    EXPECT_EQ(::send(connection, accepts_16_kB.data(), accepts_16_kB.size(), MSG_NOSIGNAL), 6);
    char taken = 0;
    while (::recv(connection, &taken, 1, 0) > 0) {  // until the other side has gone
    }
    ::close(connection);
  });
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(Archive(settings_).find_studies({}), Error);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));  // DCMTK's own limit is 60 s
  archive.join();
  ::close(listening);
}

}  // namespace
}  // namespace emmetrope::pacs
