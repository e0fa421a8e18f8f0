// Against Orthanc on the loopback.
#include "pipeline/pacs/archive.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <set>
#include <sstream>
#include <thread>

#include "pipeline/base/files.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/process.hpp"
#include "tests/support/fixture_case.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::pacs {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ArchiveOrthanc : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* program : {"/usr/sbin/Orthanc", "/usr/bin/curl"})
      if (!fs::exists(program)) GTEST_SKIP() << program << " is not installed";
    fs::create_directories(folder() / "storage");
    port_ = 20000 + ::getpid() % 20000;
    start(Json::object());
    if (curl({url("/system")}).status != 0) GTEST_SKIP() << "Orthanc does not start here";
  }
  void TearDown() override { stop(); }

  /// \param more  settings of Orthanc's besides those that every test has
  void start(const Json& more) {
    Json settings{{"Name", "test"},
                  {"StorageDirectory", (folder() / "storage").string()},
                  {"IndexDirectory", (folder() / "storage").string()},
                  {"Plugins", {"/usr/share/orthanc/plugins/libOrthancDicomWeb.so"}},
                  {"HttpPort", port_},
                  {"DicomPort", port_ + 1},
                  {"DicomAet", "ORTHANC"},
                  {"DicomModalities", {{"emmetrope", {"EMMETROPE", "127.0.0.1", port_ + 2}}}},
                  {"AuthenticationEnabled", false}};
    settings.update(more);
    write_json(folder() / "orthanc.json", settings);
    child_ = ::fork();
    if (child_ == 0) {
      ::execl("/usr/sbin/Orthanc", "Orthanc", ("--logfile=" + (folder() / "log").string()).c_str(),
              (folder() / "orthanc.json").c_str(), nullptr);
      ::_exit(127);
    }
    for (int wait = 0; wait < 300 && curl({url("/system")}).status != 0; ++wait)
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    write_settings("archive.json", Json::object());
  }
  void stop() {
    if (child_ <= 0) return;
    ::kill(child_, SIGTERM);
    ::waitpid(child_, nullptr, 0);
    child_ = -1;
  }
  void write_settings(const std::string& name, const Json& more) const {
    Json json{{"host", "127.0.0.1"}, {"port", port_ + 1}, {"called_ae_title", "ORTHANC"}, {"timeout_s", 10}};
    json.update(more);
    write_json(folder() / name, json);
  }
  std::string url(const std::string& path) const {
    return "http://127.0.0.1:" + std::to_string(port_) + path;
  }
  static ProcessResult curl(std::vector<std::string> words) {
    words.insert(words.begin(), {"--silent", "--fail"});
    return run_process("/usr/bin/curl", words, ChildOutput::capture);
  }
  ProcessResult pacs(std::vector<std::string> words, const std::string& settings = "archive.json") const {
    words.insert(words.begin() + 1, (folder() / settings).string());
    words.insert(words.end(), {"--json", "--quiet"});
    return run_process(bin() / "emmetrope-pacs", words, ChildOutput::capture);
  }
  /// The fixture's study arrives in the archive, as from a scanner.
  void send_study() const {
    if (!fs::exists(folder() / "study")) test::make_fixture_study(folder() / "study");
    const ProcessResult sent = run_process(
        *find_program("storescu"),
        {"-aec", "ORTHANC", "127.0.0.1", std::to_string(port_ + 1), "+sd", (folder() / "study").string()},
        ChildOutput::capture);
    ASSERT_EQ(sent.status, 0) << sent.output;
  }
  /// What every file of a folder says, but for how it is stored.
  static std::multiset<std::string> contents_of(const fs::path& folder) {
    std::multiset<std::string> all;
    for (const auto& entry : fs::directory_iterator(folder)) {
      std::istringstream lines(
          run_process(*find_program("dcmdump"), {"+L", entry.path().string()}, ChildOutput::capture).output);
      std::string said;
      for (std::string line; std::getline(lines, line);)
        if (!line.empty() && line.front() == '(' && line.rfind("(0002", 0) != 0) said += line + "\n";
      all.insert(said);
    }
    return all;
  }
  static fs::path bin() { return std::getenv("EMMETROPE_BIN"); }
  const fs::path& folder() const { return temporary_.path(); }

  test::TemporaryFolder temporary_;
  int port_ = 0;
  pid_t child_ = -1;
};

TEST_F(ArchiveOrthanc, GivesAStudyAndTakesWhatCameOfIt) {
  send_study();
  const Json studies = Json::parse(curl({url("/dicom-web/studies")}).output);
  ASSERT_EQ(studies.size(), 1U);
  const std::string uid = studies.at(0).at("0020000D").at("Value").at(0);
  const ProcessResult pulled = pacs({"pull", "--study-uid", uid, "-o", (folder() / "pulled").string()});
  ASSERT_EQ(pulled.status, 0) << pulled.output;
  EXPECT_EQ(Json::parse(pulled.output).at("study_uid"), uid);
  EXPECT_EQ(contents_of(folder() / "pulled"), contents_of(folder() / "study"));
  EXPECT_FALSE(fs::exists(folder() / "pulled.pulling"));

  const fs::path case_folder = folder() / "case";
  test::make_fixture_case(case_folder);
  test::note_study(case_folder, folder() / "pulled");
  const ProcessResult reported =
      run_process(bin() / "emmetrope-report",
                  {case_folder.string(), "--study", (folder() / "pulled").string(), "--json", "--quiet"},
                  ChildOutput::capture);
  ASSERT_EQ(reported.status, 0) << reported.output;
  const ProcessResult pushed = pacs({"push", case_folder.string()});
  ASSERT_EQ(pushed.status, 0) << pushed.output;
  std::size_t objects = 0;
  for (const auto& entry : fs::recursive_directory_iterator(case_folder / "report"))
    objects += entry.path().extension() == ".dcm" ? 1 : 0;
  EXPECT_EQ(Json::parse(pushed.output).at("files"), objects);

  // Found by QIDO, each kind of it, in the patient's own study.
  const Json series =
      Json::parse(curl({url("/dicom-web/series?StudyInstanceUID=" + uid + "&includefield=00080060")}).output);
  std::multiset<std::string> modalities;
  for (const Json& one : series) modalities.insert(one.at("00080060").at("Value").at(0).get<std::string>());
  for (const char* modality : {"MR", "DOC", "SR", "SEG", "RTSTRUCT", "M3D", "OT"})
    EXPECT_TRUE(modalities.count(modality) > 0) << modality << " of " << series.dump();

  // The report's PDF comes back byte by byte.
  const std::string found =
      curl({"--data", R"({"Level": "Instance", "Query": {"SOPClassUID": "1.2.840.10008.5.1.4.1.1.104.1"}})",
            url("/tools/find")})
          .output;
  const Json instances = Json::parse(found);
  ASSERT_EQ(instances.size(), 1U) << found;
  const std::string pdf = curl({url("/instances/" + instances.at(0).get<std::string>() + "/pdf")}).output;
  const std::string expected = read_file(case_folder / "report" / "report.pdf");
  EXPECT_EQ(pdf.substr(0, expected.size()), expected);
  EXPECT_LE(pdf.size(), expected.size() + 1);  // DICOM pads to an even length
}

TEST_F(ArchiveOrthanc, LeavesOutWhatIsNoImage) {
  test::make_fixture_study(folder() / "study");
  // A spectrum among the images.
  const std::string spectrum = (folder() / "study" / "slice0").string();
  run_process(*find_program("dcmodify"), {"-nb", "-m", "0008,0016=1.2.840.10008.5.1.4.1.1.4.2", spectrum},
              ChildOutput::discard);
  send_study();
  const ProcessResult pulled =
      pacs({"pull", "--patient-id", "MRN-4711", "-o", (folder() / "pulled/").string()});
  ASSERT_EQ(pulled.status, 0) << pulled.output;
  std::multiset<std::string> expected = contents_of(folder() / "study");
  for (const std::string& one : contents_of(folder() / "study"))
    if (one.find("MRSpectroscopyStorage") != std::string::npos) expected.erase(one);
  EXPECT_EQ(contents_of(folder() / "pulled").size() + 1, contents_of(folder() / "study").size());
  EXPECT_EQ(contents_of(folder() / "pulled"), expected);
}

TEST_F(ArchiveOrthanc, GivesNoImagesOfAnotherPatientUnderTheSameUid) {
  send_study();
  std::vector<std::string> words{"-nb", "-gse", "-gin", "-m", "0010,0020=MRN-4712"};
  for (const auto& entry : fs::directory_iterator(folder() / "study")) words.push_back(entry.path().string());
  ASSERT_EQ(run_process(*find_program("dcmodify"), words, ChildOutput::capture).status, 0);
  send_study();
  const auto refused = [&](const std::string& option, const std::string& value) {
    const ProcessResult pulled = pacs({"pull", option, value, "-o", (folder() / "pulled").string()});
    EXPECT_EQ(pulled.status, 3) << pulled.output;
    EXPECT_THAT(pulled.output, testing::Not(HasSubstr("MRN-471")));
    EXPECT_THAT(pulled.output, HasSubstr("a UID of its own"));
    for (const auto& entry : fs::directory_iterator(folder()))
      EXPECT_NE(entry.path().filename().string().rfind("pulled", 0), 0U) << entry.path();
    return pulled.output;
  };
  EXPECT_THAT(refused("--patient-id", "MRN-4711"), HasSubstr("another patient"));
  EXPECT_THAT(refused("--study-uid", "1.2.826.0.1.3680043.10.1.1"), HasSubstr("of 2 patients"));
}

TEST_F(ArchiveOrthanc, ImagesThatAKilledPullLeftAreSaid) {
  send_study();
  const pid_t gone = ::fork();
  if (gone == 0) ::_exit(0);
  ::waitpid(gone, nullptr, 0);
  for (const pid_t process : {gone, ::getpid()})  // the other pull goes on
    fs::create_directories(folder() / ("pulled.pulling-" + std::to_string(process)));
  const ProcessResult pulled =
      pacs({"pull", "--patient-id", "MRN-4711", "-o", (folder() / "pulled").string()});
  ASSERT_EQ(pulled.status, 0) << pulled.output;
  const Json warnings = Json::parse(pulled.output).at("warnings");
  ASSERT_EQ(warnings.size(), 1U) << warnings;
  EXPECT_THAT(warnings.at(0).get<std::string>(),
              testing::AllOf(HasSubstr("pulled.pulling-" + std::to_string(gone) + " holds"),
                             HasSubstr("no process of this machine"), HasSubstr("if none elsewhere does")));
}

TEST_F(ArchiveOrthanc, AStudyIsPulledIntoAFolderThatMayNotBeListed) {
  send_study();
  const fs::path unlisted = folder() / "unlisted";
  fs::create_directories(unlisted);
  fs::permissions(unlisted, fs::perms::owner_write | fs::perms::owner_exec);
  fs::path program = bin() / "emmetrope-pacs";
  std::vector<std::string> words{"pull", (folder() / "archive.json").string(), "--patient-id", "MRN-4711",
                                 "-o",   (unlisted / "pulled").string(),       "--quiet"};
  if (::geteuid() == 0) {  // who may list every folder
    words.insert(words.begin(), {"--bounding-set", "-dac_override,-dac_read_search", program.string()});
    program = *find_program("setpriv");
  }
  const ProcessResult pulled = run_process(program, words, ChildOutput::capture);
  fs::permissions(unlisted, fs::perms::owner_all);
  ASSERT_EQ(pulled.status, 0) << pulled.output;
  EXPECT_EQ(contents_of(unlisted / "pulled"), contents_of(folder() / "study"));
}

/// In the images in Latin 1, on the command line in UTF-8.
TEST_F(ArchiveOrthanc, FindsAPatientWhoseIdentifierIsBeyondAscii) {
  test::make_fixture_study(folder() / "study");
  std::vector<std::string> words{"-nb", "-i", "0008,0005=ISO_IR 100", "-m", "0010,0020=M\xFC-1"};
  for (const auto& entry : fs::directory_iterator(folder() / "study")) words.push_back(entry.path().string());
  ASSERT_EQ(run_process(*find_program("dcmodify"), words, ChildOutput::capture).status, 0);
  send_study();
  const ProcessResult pulled =
      pacs({"pull", "--patient-id", "M\xC3\xBC-1", "-o", (folder() / "pulled").string()});
  ASSERT_EQ(pulled.status, 0) << pulled.output;
  EXPECT_EQ(contents_of(folder() / "pulled"), contents_of(folder() / "study"));
}

TEST_F(ArchiveOrthanc, IsAskedForOneValue) {
  send_study();
  // Each beside a date that alone finds the study.
  for (const char* option : {"--patient-id", "--accession", "--study-uid"})
    for (const char* value : {"*", "MRN-47?1", "1\\2", "", " "}) {
      const ProcessResult asked =
          pacs({"pull", option, value, "--study-date", "20260314", "-o", (folder() / "pulled").string()});
      EXPECT_EQ(asked.status, 2) << option << " \"" << value << "\": " << asked.output;
    }
  for (const char* date : {"2026-03-14", "2026", "20260314-2026", "-", "20261301", "20260229",
                           "20260101-20261301", "20270101-20260101"}) {
    const ProcessResult asked = pacs({"pull", "--study-date", date, "-o", (folder() / "pulled").string()});
    EXPECT_EQ(asked.status, 2) << date;
    EXPECT_THAT(asked.output,
                testing::AllOf(HasSubstr("--study-date"), HasSubstr(date), HasSubstr("YYYYMMDD")));
  }
  EXPECT_FALSE(fs::exists(folder() / "pulled"));
}

TEST_F(ArchiveOrthanc, SaysWhatItDoesNotFind) {
  const ProcessResult none = pacs({"pull", "--accession", "no-such", "-o", (folder() / "none").string()});
  EXPECT_EQ(none.status, 3);
  EXPECT_THAT(none.output, HasSubstr("no such study"));
  EXPECT_FALSE(fs::exists(folder() / "none"));
  EXPECT_EQ(pacs({"pull", "-o", (folder() / "none").string()}).status, 2);  // everything
  EXPECT_EQ(pacs({"push", folder().string()}).status, 2);
  write_settings("wrong.json", {{"port", 1}});  // nobody listens there
  const ProcessResult nobody =
      pacs({"pull", "--accession", "1", "-o", (folder() / "none").string()}, "wrong.json");
  EXPECT_EQ(nobody.status, 3);
  EXPECT_THAT(nobody.output, HasSubstr("Connection refused"));
  write_settings("wrong.json", {{"tsl", {{"authority", "a.crt"}}}});
  const ProcessResult misspelt =
      pacs({"pull", "--accession", "1", "-o", (folder() / "none").string()}, "wrong.json");
  EXPECT_EQ(misspelt.status, 3);
  EXPECT_THAT(misspelt.output, HasSubstr("tsl"));
  for (const auto& [key, wrong] : {std::pair<const char*, Json>("port", "4242"),
                                   {"host", 1},
                                   {"timeout_s", "60"},
                                   {"called_ae_title", true}}) {
    write_settings("wrong.json", {{key, wrong}});
    const ProcessResult mistyped =
        pacs({"pull", "--accession", "1", "-o", (folder() / "none").string()}, "wrong.json");
    EXPECT_EQ(mistyped.status, 3);
    EXPECT_THAT(mistyped.output, HasSubstr(std::string("wrong.json: ") + key + " is "));
  }
  write_settings("wrong.json", {{"port", 0}});
  EXPECT_EQ(pacs({"pull", "--accession", "1", "-o", (folder() / "none").string()}, "wrong.json").status, 3);
}

TEST_F(ArchiveOrthanc, OverTlsTrustsWhomItIsToldToTrust) {
  const auto certificate = [&](const std::string& name) {
    run_process(
        "/usr/bin/openssl",
        {"req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost", "-keyout",
         (folder() / (name + ".key")).string(), "-out", (folder() / (name + ".crt")).string()},
        ChildOutput::discard);
  };
  for (const char* name : {"archive", "own", "stranger"}) certificate(name);
  stop();
  start({{"DicomTlsEnabled", true},
         {"DicomTlsCertificate", (folder() / "archive.crt").string()},
         {"DicomTlsPrivateKey", (folder() / "archive.key").string()},
         {"DicomTlsTrustedCertificates", (folder() / "own.crt").string()}});
  const auto asked = [&](const Json& tls) {
    write_settings("tls.json", tls.is_null() ? Json::object() : Json{{"tls", tls}});
    return pacs({"pull", "--accession", "no-such", "-o", (folder() / "none").string()}, "tls.json");
  };
  const Json own{{"authority", "archive.crt"}, {"certificate", "own.crt"}, {"key", "own.key"}};
  const ProcessResult trusted = asked(own);
  EXPECT_THAT(trusted.output, HasSubstr("no such study"));  // it answered
  Json stranger = own;
  stranger["authority"] = "stranger.crt";
  EXPECT_THAT(asked(stranger).output, HasSubstr("certificate verify failed"));
  stranger = own;
  stranger["certificate"] = "stranger.crt";
  stranger["key"] = "stranger.key";
  EXPECT_THAT(asked(stranger).output, testing::Not(HasSubstr("no such study")));
  EXPECT_THAT(asked(Json()).output, testing::Not(HasSubstr("no such study")));
  EXPECT_THAT(asked({{"certificate", "own.crt"}, {"key", "own.key"}}).output, HasSubstr("tls.authority"));
}

}  // namespace
}  // namespace emmetrope::pacs
