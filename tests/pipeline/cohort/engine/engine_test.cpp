// A cohort through a Slurm of this machine alone, or through scripts that are called as its commands are, with stages that
// are small shell scripts.
#include "pipeline/cohort/engine/engine.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdlib>
#include <numeric>
#include <sstream>
#include <thread>

#include "pipeline/base/files.hpp"
#include "pipeline/cohort/subjects/table.hpp"
#include "tests/support/stand_in_stages.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

TEST(EngineOptions, AreReadOrRefusedInWords) {
  EngineOptions options;
  CLI::App app;
  declare(app, options);
  app.parse("--engine slurm --jobs 3");
  EXPECT_EQ(options.engine, Engine::slurm);
  EXPECT_EQ(options.jobs, 3);
  for (const auto& [words, says] :
       {std::pair("--engine foo", "foo not in {local,slurm}"), {"--jobs 0", "0 not in range 1 to 100000"}}) {
    try {
      app.parse(words);
      ADD_FAILURE() << words;
    } catch (const CLI::ParseError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr(says));
    }
  }
}

class CohortOnSlurm : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* program : {"snakemake", "slurmctld", "slurmd", "munged"})
      if (!find_program(program)) GTEST_SKIP() << program << " is not installed";
    if (::geteuid() != 0) GTEST_SKIP() << "Slurm's daemons are started by root";
    for (const char* subject : {"broken", "empty", "good", "late"}) {
      fs::create_directories(studies() / subject);
      write_file(studies() / subject / "image", subject);
    }
    stages_.tell("broken", "segment", "3");
    stages_.tell("empty", "segment", "6");
    stages_.tell("late", "trace.once", "7");
    ::setenv("SLURM_CONF", (slurm() / "slurm.conf").c_str(), 1);
    if (tell_slurm("start") != 0) GTEST_SKIP() << "Slurm's daemons do not start here";
  }
  void TearDown() override {
    if (fs::exists(slurm())) tell_slurm("stop");
  }
  int tell_slurm(const std::string& what) const {
    return run_process(data_folder() / "tests" / "support" / "slurm", {what, slurm().string()},
                       ChildOutput::inherit)
        .status;
  }
  std::vector<std::string> words(const std::string& name, const std::string& engine) const {
    return {studies().string(), "-o", (folder() / name).string(), "--json", "--quiet", "--engine", engine};
  }
  int runs() const {
    const std::map<std::string, int> counts = stages_.runs();
    return std::accumulate(counts.begin(), counts.end(), 0,
                           [](int sum, const auto& one) { return sum + one.second; });
  }
  std::size_t ends(const std::string& name) const {
    std::size_t count = 0;
    std::error_code missing;
    for (const auto& entry : fs::recursive_directory_iterator(folder() / name / "ends", missing))
      count += entry.path().extension() == ".json" ? 1 : 0;
    return count;
  }
  void wait_for_ends(const std::string& name, std::size_t count) const {
    for (int wait = 0; wait < 1200 && ends(name) < count; ++wait)
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  /// Slurm's number of a job that runs; empty for none.
  std::string running_job() const {
    std::istringstream jobs(run_process("/usr/bin/squeue", {"--noheader", "--states=RUNNING", "--format=%i"},
                                        ChildOutput::capture)
                                .output);
    std::string job;
    jobs >> job;
    return job;
  }
  const fs::path& folder() const { return temporary_.path(); }
  fs::path studies() const { return folder() / "studies"; }
  fs::path slurm() const { return folder() / "slurm"; }

  test::TemporaryFolder temporary_;
  test::StandInStages stages_{temporary_.path()};
};

TEST_F(CohortOnSlurm, GivesTheSameTableWhateverIsKilled) {
  EXPECT_EQ(stages_.run("cohort", words("local", "local")).status, 6);  // stand-ins measure nothing
  const std::string expected = read_file(folder() / "local" / "cohort.tsv");
  const int runs_locally = runs();
  stages_.tell("late", "trace.once", "7");
  stages_.slow(true);
  const pid_t child = ::fork();
  if (child == 0) {
    ::setpgid(0, 0);
    std::vector<std::string> asked = words("out", "slurm");
    asked.insert(asked.begin(), stages_.program("cohort").string());
    std::vector<char*> argv;
    for (std::string& word : asked) argv.push_back(word.data());
    argv.push_back(nullptr);
    ::execv(argv.front(), argv.data());
    ::_exit(127);
  }
  wait_for_ends("out", 2);
  run_process("/usr/bin/scancel", {running_job()}, ChildOutput::inherit);  // a job
  wait_for_ends("out", 6);
  EXPECT_EQ(tell_slurm("stop-node"), 0);  // the node
  std::this_thread::sleep_for(std::chrono::seconds(2));
  ::kill(-child, SIGKILL);  // the workflow
  ::waitpid(child, nullptr, 0);
  EXPECT_GE(ends("out"), 6U);
  EXPECT_LT(ends("out"), 20U);
  EXPECT_EQ(tell_slurm("start-node"), 0);
  stages_.slow(false);

  const ProcessResult ended = stages_.run("cohort", words("out", "slurm"));
  EXPECT_EQ(ended.status, 6) << ended.output << read_file(engine_log(folder() / "out"));
  EXPECT_EQ(read_file(folder() / "out" / "cohort.tsv"), expected);
  // At most what was running at one of the three kills, on two cores, was begun again.
  EXPECT_LE(runs() - runs_locally, runs_locally + 5);
}

/// Slurm's commands as scripts: sbatch runs what it takes at once.
class CohortOnScripts : public testing::Test {
 protected:
  void SetUp() override {
    if (!find_program("snakemake")) GTEST_SKIP() << "snakemake is not installed";
    for (const char* subject : {"refused", "taken"}) {
      fs::create_directories(folder() / "studies" / subject);
      write_file(folder() / "studies" / subject / "image", subject);
    }
    fs::create_directories(folder() / "slurm");
    make("scontrol", "echo ' JobState=COMPLETED'");
    make("squeue", "");
    make("scancel", "");
    ::setenv("PATH", fmt::format("{}:{}", (folder() / "slurm").string(), path_).c_str(), 1);
  }
  void TearDown() override { ::setenv("PATH", path_.c_str(), 1); }
  void make(const std::string& command, const std::string& lines) const {
    const fs::path script = folder() / "slurm" / command;
    write_file(script, "#!/bin/sh\n" + lines + "\n");
    fs::permissions(script, fs::perms::owner_all);
  }
  /// \param refused  what the scripts of jobs that sbatch refuses hold
  void make_sbatch(const std::string& refused) const {
    make("sbatch",
         fmt::format("for job; do :; done\n"
                     "if grep -q '{}' \"$job\"; then\n"
                     "  echo 'sbatch: error: Batch job submission failed: Invalid partition' >&2; exit 1\n"
                     "fi\n"
                     "sh \"$job\" >&2; echo 1",
                     refused));
  }
  ProcessResult run() const {
    return stages_.run("cohort", {(folder() / "studies").string(), "-o", (folder() / "out").string(),
                                  "--json", "--quiet", "--engine", "slurm"});
  }
  const fs::path& folder() const { return temporary_.path(); }

  std::string path_ = std::getenv("PATH");
  test::TemporaryFolder temporary_;
  test::StandInStages stages_{temporary_.path()};
};

TEST_F(CohortOnScripts, ThatTakesNoJobSaysNothingOfTheSubjects) {
  make_sbatch("snakemake");
  const ProcessResult ended = run();
  EXPECT_EQ(ended.status, 1);
  EXPECT_THAT(
      Json::parse(ended.output)["error"]["message"].get<std::string>(),
      testing::HasSubstr("no job began: sbatch: error: Batch job submission failed: Invalid partition"));
  EXPECT_FALSE(fs::exists(folder() / "out" / "cohort.tsv"));
  EXPECT_FALSE(fs::exists(folder() / "out" / "ends" / "taken" / "segment.json"));
}

TEST_F(CohortOnScripts, ThatTakesSomeJobsSaysWhichDidNotBegin) {
  make_sbatch("ends/refused/segment\\|ends/taken/mesh");
  EXPECT_EQ(run().status, 6);  // stand-ins measure nothing
  const Table table = read_table(folder() / "out" / "cohort.tsv", {"participant_id"});
  ASSERT_EQ(table.rows.size(), 4U);
  EXPECT_EQ(table.cell(0, "participant_id"), "refused");
  EXPECT_EQ(table.cell(0, "stage"), "segment");
  EXPECT_EQ(table.cell(2, "stage"), "mesh");
  for (const std::size_t row : {0, 2}) {
    EXPECT_EQ(table.cell(row, "outcome"), "failed");
    EXPECT_THAT(table.cell(row, "reason"), testing::HasSubstr("no attempt of it began"));
  }
}

TEST_F(CohortOnScripts, WhoseEngineFailsSaysItsLastLines) {
  make_sbatch("nothing");
  make("snakemake", "for i in 1 2 3 4 5 6 7; do echo line $i; done; exit 9");
  const ProcessResult ended = run();
  EXPECT_EQ(ended.status, 1);
  EXPECT_EQ(Json::parse(ended.output)["error"]["message"],
            "snakemake ended with 9: line 3\nline 4\nline 5\nline 6\nline 7");
}

TEST_F(CohortOnScripts, WithoutAControllerIsRefusedBeforeAnythingIsWritten) {
  make("scontrol", "echo 'Slurmctld(primary) at head is DOWN'; exit 1");
  make_sbatch("nothing");
  const ProcessResult ended = run();
  EXPECT_EQ(ended.status, 1);
  EXPECT_THAT(Json::parse(ended.output)["error"]["message"].get<std::string>(),
              testing::HasSubstr("Slurmctld(primary) at head is DOWN"));
  EXPECT_FALSE(fs::exists(folder() / "out"));
}

}  // namespace
}  // namespace emmetrope::cohort
