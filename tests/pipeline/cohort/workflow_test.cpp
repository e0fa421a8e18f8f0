// The workflow with stages that are small shell scripts beside copies of its own programs.
#include "pipeline/cohort/workflow.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/cohort/subjects/table.hpp"
#include "tests/support/stand_in_stages.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

class Workflow : public testing::Test {
 protected:
  void SetUp() override {
    if (!find_program("snakemake")) GTEST_SKIP() << "snakemake is not installed";
    for (const char* subject : {"broken", "empty", "good", "late"}) {
      fs::create_directories(studies() / subject);
      write_file(studies() / subject / "image", subject);
    }
  }
  std::vector<std::string> words(const std::string& name, int jobs) const {
    return {studies().string(), "-o",     (folder() / name).string(), "--json",
            "--quiet",          "--jobs", std::to_string(jobs)};
  }
  ProcessResult run(const std::string& name = "out", int jobs = 2) const {
    return stages_.run("cohort", words(name, jobs));
  }
  const fs::path& folder() const { return temporary_.path(); }
  fs::path studies() const { return folder() / "studies"; }

  test::TemporaryFolder temporary_;
  test::StandInStages stages_{temporary_.path()};
};

TEST_F(Workflow, GoesOnAfterSubjectsThatFailAndTriesTheMachinesFaultsAgain) {
  stages_.tell("broken", "segment", "3");
  stages_.tell("empty", "segment", "6");
  stages_.tell("late", "trace.once", "7");
  const ProcessResult ended = run();
  EXPECT_EQ(ended.status, 6) << ended.output;  // stand-ins measure nothing
  const Table table = read_table(folder() / "out" / "cohort.tsv", {"participant_id"});
  ASSERT_EQ(table.rows.size(), 8U);
  EXPECT_EQ(table.cell(0, "outcome"), "failed");
  EXPECT_EQ(table.cell(0, "reason"), "told by segment");
  EXPECT_EQ(table.cell(2, "outcome"), "no_result");
  EXPECT_EQ(table.cell(2, "reason"), "why");
  EXPECT_EQ(stages_.runs().at("trace late"), 2);
  EXPECT_EQ(stages_.runs().at("report late"), 1);
  EXPECT_EQ(stages_.runs().count("mesh broken"), 0U);
  EXPECT_EQ(stages_.runs().count("mesh empty"), 0U);
  EXPECT_EQ(stages_.runs().at("report empty"), 1);  // which tells why
  EXPECT_TRUE(fs::exists(folder() / "out" / "cohort.html"));

  const std::map<std::string, int> before = stages_.runs();
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs(), before);
  write_file(studies() / "good" / "another", "image");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs().at("report good"), 2);
  EXPECT_EQ(stages_.runs().at("segment late"), before.at("segment late"));

  const std::string whole = read_file(folder() / "out" / "cohort.tsv");
  EXPECT_EQ(run("one at a time", 1).status, 6);
  EXPECT_EQ(read_file(folder() / "one at a time" / "cohort.tsv"), whole);
}

TEST_F(Workflow, AFaultOfTheMachineThatStaysIsToldAfterThreeAttempts) {
  stages_.tell("late", "mesh", "5");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs().at("mesh late"), 3);
  const Table table = read_table(folder() / "out" / "cohort.tsv", {"participant_id"});
  EXPECT_EQ(table.cell(6, "participant_id"), "late");
  EXPECT_EQ(table.cell(6, "outcome"), "failed");
  EXPECT_EQ(table.cell(6, "stage"), "mesh");
  stages_.forget("late", "mesh");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs().at("mesh late"), 4);
  EXPECT_EQ(stages_.runs().at("report late"), 1);
  EXPECT_EQ(stages_.runs().at("segment late"), 1);
}

TEST_F(Workflow, AFaultOfTheMachineCostsNoResultThatIsThere) {
  EXPECT_EQ(run().status, 6);
  write_file(studies() / "late" / "another", "image");
  stages_.tell("late", "segment", "5");  // in use by another run, say
  EXPECT_EQ(run().status, 6);
  const fs::path late = folder() / "out" / "cases" / "late";
  for (const PipelineStage& stage : pipeline_stages)
    EXPECT_TRUE(fs::exists(late / stage.folder)) << stage.folder;
  const Table table = read_table(folder() / "out" / "cohort.tsv", {});
  EXPECT_EQ(table.cell(6, "outcome"), "failed");
  EXPECT_EQ(table.cell(6, "stage"), "segment");
}

TEST_F(Workflow, AJobThatIsKilledAtEveryAttemptIsAFailureOfItsSubject) {
  stages_.tell("late", "mesh", "kill");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs().at("mesh late"), 3);
  EXPECT_EQ(stages_.runs().at("report good"), 1);
  const Table table = read_table(folder() / "out" / "cohort.tsv", {});
  ASSERT_EQ(table.rows.size(), 8U);
  EXPECT_EQ(table.cell(6, "outcome"), "failed");
  EXPECT_THAT(table.cell(6, "reason"), testing::HasSubstr("ended from outside"));
  stages_.forget("late", "mesh");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs().at("report late"), 1);
}

TEST_F(Workflow, WhatFollowedAnotherPlanIsDoneAgain) {
  EXPECT_EQ(run().status, 6);
  const fs::path end = folder() / "out" / "ends" / "good" / "trace.json";
  Json json = read_json(end);
  json["plan"] = "of a job that was running when the plan was changed";
  write_json(end, json);
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs().at("mesh good"), 1);
  EXPECT_EQ(stages_.runs().at("trace good"), 2);
  EXPECT_EQ(stages_.runs().at("report good"), 2);
}

TEST_F(Workflow, NothingOfAnEarlierRunIsLeftOfAStudyThatFailsNow) {
  EXPECT_EQ(run().status, 6);
  const fs::path cases = folder() / "out" / "cases";
  EXPECT_TRUE(fs::exists(cases / "good" / "segmentation"));
  write_json(cases / "good" / "case.json", {{"subject", {{"age_years", 40}}}});
  write_file(studies() / "good" / "another", "image");
  stages_.tell("good", "segment", "3");
  EXPECT_EQ(run().status, 6);
  EXPECT_FALSE(fs::exists(cases / "good" / "segmentation"));
  EXPECT_FALSE(fs::exists(cases / "good" / "meshing"));
  EXPECT_EQ(read_table(folder() / "out" / "cohort.tsv", {}).cell(4, "age"), "");
}

/// A stage refuses to write over what somebody put among its results: that is no fault of the data.
TEST_F(Workflow, ARefusalCostsNothingThatSomebodyPutIntoACase) {
  EXPECT_EQ(run().status, 6);
  const fs::path good = folder() / "out" / "cases" / "good", notes = good / "segmentation" / "notes.txt";
  write_file(notes, "mine");
  write_file(studies() / "good" / "another", "image");
  stages_.tell("good", "segment", "3");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(read_file(notes), "mine");
  for (const PipelineStage& stage : pipeline_stages)
    EXPECT_TRUE(fs::exists(good / stage.folder / "stage.json")) << stage.folder;
  EXPECT_EQ(read_table(folder() / "out" / "cohort.tsv", {}).cell(4, "outcome"), "failed");
  fs::remove(notes);
  stages_.forget("good", "segment");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(read_table(folder() / "out" / "cohort.tsv", {}).cell(4, "outcome"), "no_result");
  EXPECT_EQ(stages_.runs().at("report good"), 2);
}

TEST_F(Workflow, ACaseThatIsGoneIsMadeAgain) {
  EXPECT_EQ(run().status, 6);
  fs::remove_all(folder() / "out" / "cases" / "good");
  EXPECT_EQ(run().status, 6);
  EXPECT_EQ(stages_.runs().at("segment good"), 2);
  EXPECT_EQ(stages_.runs().at("report good"), 2);
  EXPECT_EQ(stages_.runs().at("segment late"), 1);
}

TEST_F(Workflow, ABrokenFileIsAFailureOfItsSubject) {
  EXPECT_EQ(run().status, 6);
  write_file(folder() / "out" / "cases" / "good" / "case.json", "{ broken");
  const Table table = [&] {
    EXPECT_EQ(stages_.run("cohort-table", {(folder() / "out").string()}).status, 0);
    return read_table(folder() / "out" / "cohort.tsv", {});
  }();
  ASSERT_EQ(table.rows.size(), 8U);
  EXPECT_EQ(table.cell(4, "outcome"), "failed");
  EXPECT_THAT(table.cell(4, "reason"), testing::HasSubstr("case.json"));
  EXPECT_EQ(table.cell(0, "outcome"), "no_result");
  write_file(folder() / "out" / "ends" / "late" / "mesh.json", "{ broken");
  EXPECT_EQ(run().status, 6);  // which makes it again
  EXPECT_EQ(stages_.runs().at("mesh late"), 2);
}

TEST_F(Workflow, ItsCasesAreNotItsStudies) {
  EXPECT_EQ(run().status, 6);
  const fs::path cases = folder() / "out" / "cases";
  write_file(cases / "good" / "segmentation" / "mine", "");
  EXPECT_EQ(stages_.run("cohort", {cases.string(), "-o", (folder() / "out").string(), "--quiet"}).status, 2);
  EXPECT_TRUE(fs::exists(cases / "good" / "segmentation" / "mine"));
}

TEST_F(Workflow, IsNotWrittenIntoTheStudies) {
  for (const char* out : {"studies", "studies/out", "studies/good/out"}) {
    EXPECT_EQ(run(out).status, 2) << out;
    EXPECT_FALSE(fs::exists(folder() / out / "subjects.txt"));
  }
}

TEST_F(Workflow, PassesOnWhatAllStagesAreAskedFor) {
  std::vector<std::string> asked = words("out", 2);
  asked.insert(asked.end(), {"--laterality", "od", "--seed", "7"});
  stages_.run("cohort", asked);
  EXPECT_EQ(read_table(folder() / "out" / "cohort.tsv", {}).rows.size(), 4U);  // one eye of each
  const Json options = read_json(folder() / "out" / "subjects" / "good.json").at("options");
  for (const PipelineStage& stage : pipeline_stages)
    EXPECT_THAT(options.at(stage.command).get<std::vector<std::string>>(),
                testing::ElementsAre("--seed", "7", "--laterality", "od"));
}

TEST_F(Workflow, ThatIsKilledGoesOnWithWhatIsNotDone) {
  stages_.slow(true);
  const std::vector<std::string> asked = words("out", 2);
  const pid_t child = ::fork();
  if (child == 0) {
    ::setpgid(0, 0);
    std::vector<char*> argv;
    const std::string program = stages_.program("cohort").string();
    argv.push_back(const_cast<char*>(program.c_str()));
    for (const std::string& word : asked) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    ::execv(program.c_str(), argv.data());
    ::_exit(127);
  }
  const auto ends = [&] {
    std::size_t count = 0;
    std::error_code missing;
    for (const auto& entry : fs::recursive_directory_iterator(folder() / "out" / "ends", missing))
      count += entry.path().extension() == ".json" ? 1 : 0;
    return count;
  };
  for (int wait = 0; wait < 600 && ends() < 5; ++wait)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  ::kill(-child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  const std::size_t done = ends();
  ASSERT_GE(done, 5U);
  ASSERT_LT(done, 20U);
  stages_.slow(false);
  EXPECT_EQ(run().status, 6);
  int begun = 0;
  for (const auto& [what, count] : stages_.runs()) begun += count;
  EXPECT_EQ(stages_.runs().size(), 20U);
  EXPECT_LE(begun, 22);  // two were running
  EXPECT_EQ(ends(), 20U);
}

}  // namespace
}  // namespace emmetrope::cohort
