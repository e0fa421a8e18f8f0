// The driver with stages that are small shell scripts beside a copy of it: order, statuses, what is passed
// on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class Driver : public testing::Test {
 protected:
  test::TemporaryFolder folder;
  fs::path bin = folder.path() / "bin";
  fs::path case_folder = folder.path() / "case";
  fs::path log = folder.path() / "log";

  void SetUp() override {
    fs::create_directory(bin);
    const fs::path built = std::getenv("EMMETROPE_BIN");
    for (const char* name : {"emmetrope", "emmetrope-run"}) fs::copy_file(built / name, bin / name);
    const std::vector<std::pair<std::string, std::string>> stages{{"segment", "segmentation"},
                                                                  {"mesh", "meshing"},
                                                                  {"trace", "raytrace"},
                                                                  {"correct", "correction"},
                                                                  {"report", "report"}};
    for (const auto& [command, stage] : stages) make_stage(command, stage, 0);
  }

  /// Options are checked by the stage itself.
  void make_stage(const std::string& command, const std::string& stage, int status) {
    const fs::path script = bin / ("emmetrope-" + command);
    std::ofstream(script) << "#!/bin/sh\ncase \" $* \" in *' --check-options '*) exec "
                          << fs::path(std::getenv("EMMETROPE_BIN")) / script.filename()
                          << " \"$@\";; esac\necho \"" << command << " $*\" >>" << log << "\nmkdir -p "
                          << case_folder / stage << "\ntest -e " << case_folder / stage / "stage.json"
                          << " || echo '{\"verdict\": {\"status\": " << status << ", \"reasons\": [\"why "
                          << command << "\"]}, \"inputs\": {}}' >" << case_folder / stage / "stage.json"
                          << "\necho '{\"error\": {\"message\": \"told by " << command << "\"}}'\nexit "
                          << status << "\n";
    fs::permissions(script, fs::perms::owner_all);
  }

  ProcessResult run(std::vector<std::string> more = {}) {
    std::vector<std::string> words{"run", "the study", "-o", case_folder.string(), "--json", "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    return run_process(bin / "emmetrope", words, ChildOutput::capture);
  }
};

TEST_F(Driver, RunsTheStagesInOrderAndAnswersOnceForAll) {
  const ProcessResult result = run();
  EXPECT_EQ(result.status, 0);
  const Json answer = Json::parse(result.output);  // nothing of the stages' output is mixed in
  ASSERT_EQ(answer["stages"].size(), 5U);
  EXPECT_EQ(answer["stages"][0]["stage"], "segment");
  EXPECT_EQ(answer["stages"][4]["stage"], "report");
  EXPECT_FALSE(answer["stages"][1]["skipped"].get<bool>());
  EXPECT_EQ(answer["report"], (case_folder / "report/report.html").string());
  EXPECT_THAT(read_file(log), HasSubstr("segment the study -o " + case_folder.string()));
  EXPECT_TRUE(Json::parse(run().output)["stages"][1]["skipped"].get<bool>());
}

TEST_F(Driver, APointBesideThePoleIsOfOneEye) {
  EXPECT_EQ(run({"--fovea", "1.5,0"}).status, 2);
  EXPECT_FALSE(fs::exists(log));
  EXPECT_EQ(run({"--fovea", "0,-0.4+-0.2"}).status, 0);
  EXPECT_EQ(run({"--fovea", "1.5,0", "--laterality", "od"}).status, 0);
  EXPECT_THAT(read_file(log), HasSubstr("trace " + case_folder.string() + " --fovea 1.5,0"));
  // What is corrected is what was traced.
  EXPECT_THAT(read_file(log), Not(HasSubstr("correct " + case_folder.string() + " --fovea")));
}

/// Before the minutes that the stages before them take.
TEST_F(Driver, ReadingsThatCannotBeReadAreRefusedAtOnce) {
  for (const auto& [option, value] : {std::pair("--keratometry", "os:43@90,44.5@180"),
                                      {"--axial-length", "od:235"},
                                      {"--acd", "3.4"},
                                      {"--refraction", "-2.25"},
                                      {"--refraction", "od:-2.25/-1.00x230"}})
    EXPECT_EQ(run({option, value}).status, 2) << option << " " << value;
  EXPECT_EQ(run({"--refraction", "od:-2", "--refraction", "od:-3"}).status, 2);
  EXPECT_EQ(run({"--topography", "od:/no/such/file.csv"}).status, 3);
  EXPECT_FALSE(fs::exists(log));
  EXPECT_EQ(run({"--refraction", "od:-2.25/-1.00x23", "--acd", "od:3.4"}).status, 0);
}

TEST_F(Driver, OptionsOfLaterStagesAreRefusedAtOnce) {
  for (const auto& [option, value] : {std::pair("--vertex-distance", "50"),
                                      {"--vertex-distance", "1"},
                                      {"--scale-sd", "-1"},
                                      {"--retinal-depth", "9"},
                                      {"--scene", "nope"},
                                      {"--lens-index", "1.1"},
                                      {"--lens-model", "foo"},
                                      {"--age", "300"}}) {
    const ProcessResult result = run({option, value});
    EXPECT_EQ(result.status, 2) << option << " " << value;
    EXPECT_THAT(Json::parse(result.output)["error"]["message"].get<std::string>(),
                HasSubstr("refuses its options"));
  }
  EXPECT_FALSE(fs::exists(log));
  EXPECT_FALSE(fs::exists(case_folder));
}

TEST_F(Driver, HandsOptionsToTheStageThatTheyBelongTo) {
  run({"--keratometry", "od:43@180/44@90", "--keratometry", "os:42@0/42@90", "--laterality", "od",
       "--threads", "1"});
  const std::string said = read_file(log);
  EXPECT_THAT(said, HasSubstr("mesh " + case_folder.string() +
                              " --keratometry od:43@180/44@90 --keratometry os:42@0/42@90"));
  EXPECT_THAT(said, HasSubstr("report " + case_folder.string() + " --json"));
  EXPECT_THAT(said, HasSubstr("--threads 1 --laterality od"));
}

TEST_F(Driver, ReportsWhyThereIsNoResult) {
  run();
  make_stage("mesh", "meshing", 6);
  fs::remove(log);
  const ProcessResult result = run();
  EXPECT_EQ(result.status, 6);
  EXPECT_THAT(read_file(log), Not(HasSubstr("trace")));
  EXPECT_THAT(read_file(log), HasSubstr("report"));
  EXPECT_FALSE(fs::exists(case_folder / "raytrace"));  // of an earlier run: would contradict the report
}

TEST_F(Driver, SaysThatOneEyeOfTwoIsPartial) {
  make_stage("segment", "segmentation", 8);
  const ProcessResult result = run();
  EXPECT_EQ(result.status, 8);
  EXPECT_EQ(Json::parse(result.output)["stages"][0]["reasons"][0], "why segment");
  EXPECT_THAT(read_file(log), HasSubstr("report"));
}

TEST_F(Driver, EndsAsInterruptedWhenAStageWas) {
  for (const int status : {130, 143}) {
    make_stage("mesh", "meshing", status);
    EXPECT_EQ(run().status, status);
  }
}

TEST_F(Driver, HandsOnFoldersThatLookLikeOptions) {
  const std::string before = fs::current_path().string();
  fs::current_path(folder.path());
  const ProcessResult result =
      run_process(bin / "emmetrope", {"run", "the study", "-o", "-case", "--quiet"}, ChildOutput::capture);
  fs::current_path(before);
  EXPECT_THAT(read_file(log), HasSubstr("mesh ./-case"));
}

TEST_F(Driver, KnowsBeforeTheFirstStageThatADeviceIsMissing) {
  fs::copy_file(fs::path(std::getenv("EMMETROPE_BIN")) / "emmetrope-devices", bin / "emmetrope-devices");
  const ProcessResult result = run({"--device", "no such device"});
  EXPECT_EQ(result.status, 7);
  EXPECT_THAT(Json::parse(result.output)["error"]["message"].get<std::string>(), HasSubstr("no such device"));
  EXPECT_FALSE(fs::exists(log));
}

TEST_F(Driver, EndsWithTheStatusOfAStageThatFails) {
  make_stage("trace", "raytrace", 7);
  const ProcessResult result = run();
  EXPECT_EQ(result.status, 7);
  EXPECT_THAT(Json::parse(result.output)["error"]["message"].get<std::string>(), HasSubstr("told by trace"));
  EXPECT_THAT(read_file(log), Not(HasSubstr("correct")));
}

TEST_F(Driver, KeepsASecondRunOutOfTheCase) {
  const CaseLock lock(case_folder, true);
  ::unsetenv("EMMETROPE_CASE_LOCK");  // or the driver would take it for the one that it inherited
  EXPECT_EQ(run().status, 5);
}

TEST_F(Driver, RefusesWhatIsNotItsOwn) {
  EXPECT_EQ(run_process(bin / "emmetrope", {"nonsense"}, ChildOutput::discard).status, 2);
  EXPECT_EQ(run_process(bin / "emmetrope", {"run"}, ChildOutput::discard).status, 2);
  EXPECT_EQ(run_process(bin / "emmetrope", {"--version"}, ChildOutput::discard).status, 0);
}

}  // namespace
}  // namespace emmetrope
