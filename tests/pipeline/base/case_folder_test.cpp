#include "pipeline/base/case_folder.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "pipeline/base/files.hpp"
#include "pipeline/base/interrupt.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;

class Stage : public testing::Test {
 protected:
  StageSpec spec() const { return {"meshing", Json{{"edge_mm", edge_mm}}, {{"in.txt", input}}, false, {}}; }

  /// Runs the stage, counting how often the work is really done.
  StageOutcome run() {
    return run_stage(case_folder, spec(), common, [&](StageWorkspace& workspace) {
      ++worked;
      fs::create_directory(workspace.folder() / "od");
      write_file(workspace.folder() / "od" / "out.txt", "made from " + read_file(input));
      write_file(workspace.case_file("case.json"), "{}");
      workspace.warn("a warning");
      return StageVerdict{ExitStatus::partial, {"one eye only"}};
    });
  }

  test::TemporaryFolder folder;
  fs::path case_folder = folder.path() / "case";
  fs::path input = folder.path() / "in.txt";
  CommonOptions common;
  double edge_mm = 0.4;
  int worked = 0;

  void SetUp() override { write_file(input, "one"); }
};

TEST_F(Stage, WritesOutputsProvenanceAndVerdict) {
  const StageOutcome outcome = run();
  EXPECT_FALSE(outcome.skipped);
  EXPECT_EQ(read_file(case_folder / "meshing/od/out.txt"), "made from one");
  EXPECT_EQ(read_file(case_folder / "case.json"), "{}");
  const Json stage = read_json(case_folder / "meshing/stage.json");
  EXPECT_EQ(stage["inputs"]["in.txt"], sha256_of("one"));
  EXPECT_EQ(stage["outputs"]["meshing/od/out.txt"], sha256_of("made from one"));
  EXPECT_EQ(stage["warnings"][0], "a warning");
  EXPECT_EQ(read_verdict(case_folder, "meshing").status, ExitStatus::partial);
  EXPECT_EQ(read_verdict(case_folder, "meshing").reasons[0], "one eye only");
}

TEST_F(Stage, AVerdictThatNoStageGivesIsRefused) {
  run();
  const fs::path file = case_folder / "meshing/stage.json";
  const Json whole = read_json(file);
  for (const Json& status : {Json(5), Json(8e300), Json("8"), Json()}) {
    Json edited = whole;
    edited["verdict"]["status"] = status;
    write_json(file, edited);
    try {
      read_verdict(case_folder, "meshing");
      ADD_FAILURE() << status;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find("verdict.status"), std::string::npos) << error.what();
    }
  }
}

TEST_F(Stage, IsSkippedOnlyWhileNothingChanged) {
  run();
  EXPECT_TRUE(run().skipped);
  EXPECT_EQ(run().verdict.status, ExitStatus::partial);
  EXPECT_EQ(worked, 1);
  write_file(input, "two");
  EXPECT_FALSE(run().skipped);
  edge_mm = 0.3;
  EXPECT_FALSE(run().skipped);
  common.seed = 2;
  EXPECT_FALSE(run().skipped);
  common.threads = 2;  // decides nothing about the result
  EXPECT_TRUE(run().skipped);
  common.force = true;
  EXPECT_FALSE(run().skipped);
}

TEST_F(Stage, OneEyeOfAResultForBothIsThereAlready) {
  const auto run_for = [&](LateralityChoice eyes, bool force = false) {
    common.laterality = eyes;
    common.force = force;
    StageSpec one{
        "raytrace", {{"laterality", eyes == LateralityChoice::both ? "both" : "od"}}, {}, false, {}};
    return run_stage(case_folder, one, common, [&](StageWorkspace& workspace) {
      for (const Laterality eye : both_eyes)
        if (includes(eyes, eye)) {
          fs::create_directories(workspace.folder() / to_string(eye));
          write_file(workspace.folder() / to_string(eye) / "out.txt", "seen");
        }
      return StageVerdict{};
    });
  };
  EXPECT_FALSE(run_for(LateralityChoice::both).skipped);
  EXPECT_TRUE(run_for(LateralityChoice::od).skipped);
  EXPECT_TRUE(fs::exists(case_folder / "raytrace/os/out.txt"));
  // Made anew for one eye, the stage is that eye's: what goes is named.
  const StageOutcome alone = run_for(LateralityChoice::od, true);
  EXPECT_FALSE(fs::exists(case_folder / "raytrace/os"));
  ASSERT_EQ(alone.stage_json["warnings"].size(), 1U);
  EXPECT_EQ(alone.stage_json["warnings"][0].get<std::string>().rfind("OS (left): ", 0), 0U);
  EXPECT_FALSE(run_for(LateralityChoice::both).skipped);
}

/// A stage before that was made anew for one eye has dropped the other: what was made from that one is of no eye any more.
TEST_F(Stage, OneEyeOfAResultForBothIsNotThereWhereTheOtherEyesInputIsGone) {
  const auto run_for = [&](LateralityChoice eyes) {
    common.laterality = eyes;
    StageSpec one{"correction", {{"laterality", to_string(eyes)}}, {}, false, {}};
    for (const Laterality eye : both_eyes)
      if (includes(eyes, eye)) {
        const std::string name = std::string("raytrace/") + to_string(eye) + "/eye.json";
        one.inputs.push_back({name, case_folder / name});
      }
    return run_stage(case_folder, one, common, [&](StageWorkspace&) { return StageVerdict{}; });
  };
  StageSpec before{"raytrace", Json::object(), {}, false, {}};
  run_stage(case_folder, before, common, [&](StageWorkspace& workspace) {
    for (const char* eye : {"od", "os"}) {
      fs::create_directories(workspace.folder() / eye);
      write_file(workspace.folder() / eye / "eye.json", eye);
    }
    return StageVerdict{};
  });
  EXPECT_FALSE(run_for(LateralityChoice::both).skipped);
  EXPECT_TRUE(run_for(LateralityChoice::os).skipped);
  common.force = true;
  run_stage(case_folder, before, common, [&](StageWorkspace& workspace) {
    fs::create_directories(workspace.folder() / "os");
    write_file(workspace.folder() / "os" / "eye.json", "os");
    return StageVerdict{};
  });
  common.force = false;
  EXPECT_FALSE(run_for(LateralityChoice::os).skipped);
  EXPECT_NO_THROW(read_verdict(case_folder, "correction"));
}

TEST_F(Stage, WhatAStageDidNotWriteOutlivesItsResult) {
  run();
  EXPECT_TRUE(is_as_written(case_folder, "meshing"));
  write_file(case_folder / "meshing/od/notes.txt", "mine");
  EXPECT_FALSE(is_as_written(case_folder, "meshing"));
  remove_result(case_folder, "meshing");
  EXPECT_EQ(read_file(case_folder / "meshing/od/notes.txt"), "mine");
  EXPECT_FALSE(fs::exists(case_folder / "meshing/od/out.txt"));
  EXPECT_FALSE(fs::exists(case_folder / "meshing/stage.json"));
  EXPECT_FALSE(fs::exists(case_folder / "case.json"));
  EXPECT_FALSE(is_as_written(case_folder, "meshing"));
}

TEST_F(Stage, WritesNotOverWhatSomebodyPutAmongItsResults) {
  run();
  const fs::path notes = case_folder / "meshing/od/notes.txt";
  write_file(notes, "mine");
  write_file(input, "two");
  const auto refused = [&] {
    try {
      run();
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refused().find("notes.txt was not written by meshing"), std::string::npos) << refused();
  remove_result(case_folder, "meshing");
  EXPECT_NE(refused().find("notes.txt"), std::string::npos);
  EXPECT_EQ(read_file(notes), "mine");
  fs::rename(notes, folder.path() / "notes.txt");
  EXPECT_FALSE(run().skipped);
  write_file(notes, "mine");
  common.force = true;
  EXPECT_FALSE(run().skipped);
}

TEST_F(Stage, AForgedResultRemovesNothingOutsideItsCase) {
  run();
  const fs::path outside = folder.path() / "outside.txt", file = case_folder / "meshing/stage.json";
  write_file(outside, "mine");
  Json stage = read_json(file);
  for (const std::string& name :
       {std::string("../outside.txt"), std::string("meshing/../../outside.txt"), outside.string()})
    stage["outputs"][name] = sha256_of("mine");
  write_json(file, stage);
  remove_result(case_folder, "meshing");
  EXPECT_EQ(read_file(outside), "mine");
  EXPECT_FALSE(fs::exists(file));
}

TEST_F(Stage, AnEditedResultOutlivesItsStageAndAnUntouchedOneLeavesNothing) {
  run();
  write_file(case_folder / "case.json", "edited");
  EXPECT_FALSE(is_as_written(case_folder, "meshing"));
  remove_result(case_folder, "meshing");
  EXPECT_EQ(read_file(case_folder / "case.json"), "edited");
  EXPECT_FALSE(fs::exists(case_folder / "meshing"));
  EXPECT_NO_THROW(remove_result(case_folder, "meshing"));  // nothing is there
}

TEST_F(Stage, IsRedoneWhenAnOutputWasTouched) {
  run();
  std::ofstream(case_folder / "meshing/od/out.txt") << "edited";
  EXPECT_FALSE(run().skipped);
  fs::remove(case_folder / "case.json");
  EXPECT_FALSE(run().skipped);
  std::ofstream(case_folder / "meshing/stage.json") << "{ broken";
  EXPECT_FALSE(run().skipped);
  EXPECT_TRUE(run().skipped);
}

TEST_F(Stage, LeavesTheCaseAsItWasWhenItFails) {
  run();
  write_file(input, "two");
  EXPECT_THROW(run_stage(case_folder, spec(), common,
                         [&](StageWorkspace& workspace) -> StageVerdict {
                           write_file(workspace.folder() / "half.txt", "half");
                           throw input_error("no");
                         }),
               Error);
  EXPECT_EQ(read_file(case_folder / "meshing/od/out.txt"), "made from one");
  EXPECT_FALSE(fs::exists(case_folder / "meshing/half.txt"));
  EXPECT_FALSE(fs::exists(case_folder / ".writing-meshing"));
}

TEST_F(Stage, OfAnInputThatChangesWhileItIsReadMakesNothing) {
  run();
  common.force = true;
  const auto run_while = [&](const std::function<void()>& change) {
    return run_stage(case_folder, spec(), common, [&](StageWorkspace& workspace) {
      write_file(workspace.folder() / "out.txt", read_file(input));
      change();
      return StageVerdict{ExitStatus::done, {}};
    });
  };
  for (const auto& [change, said] : {std::pair<std::function<void()>, std::string>{
                                         [&] { write_file(input, "two"); }, "changed while it was read"},
                                     {[&] { fs::remove(input); }, "was removed while it was read"}}) {
    write_file(input, "one");
    try {
      run_while(change);
      ADD_FAILURE() << said;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find(input.string() + " " + said), std::string::npos)
          << error.what();
    }
    EXPECT_EQ(read_file(case_folder / "meshing/od/out.txt"), "made from one");
  }
}

TEST_F(Stage, LeavesNoFolderWhereNothingCameOfIt) {
  EXPECT_THROW(run_stage(case_folder, spec(), common,
                         [](StageWorkspace&) -> StageVerdict { throw input_error("no study"); }),
               Error);
  EXPECT_FALSE(fs::exists(case_folder));
}

TEST_F(Stage, LeavesAFolderOfOtherFilesAsItWasWhereNothingCameOfIt) {
  fs::create_directories(case_folder);
  write_json(case_folder / "notes.json", {});
  EXPECT_THROW(run_stage(case_folder, spec(), common,
                         [](StageWorkspace&) -> StageVerdict { throw input_error("no study"); }),
               Error);
  EXPECT_EQ(std::distance(fs::directory_iterator(case_folder), fs::directory_iterator()), 1);
}

TEST_F(Stage, RefusesACaseThatAnotherRunHolds) {
  std::array<int, 2> ready{};
  ASSERT_EQ(::pipe(ready.data()), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const CaseLock lock(case_folder, true);
    char byte = 1;
    if (::write(ready[1], &byte, 1) != 1) ::_exit(1);
    ::pause();
    ::_exit(0);
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  try {
    run();
    ADD_FAILURE() << "two runs in one case";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::not_writable);
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_FALSE(run().skipped);  // a killed run's lock is free
}

TEST_F(Stage, AKilledRunIsSimplyDoneAgain) {
  const pid_t child = ::fork();
  if (child == 0) {
    run_stage(case_folder, spec(), common, [&](StageWorkspace& workspace) -> StageVerdict {
      write_file(workspace.folder() / "half.txt", "half");
      ::raise(SIGKILL);
      return {};
    });
  }
  ::waitpid(child, nullptr, 0);
  EXPECT_FALSE(fs::exists(case_folder / "meshing"));
  EXPECT_FALSE(run().skipped);
  EXPECT_FALSE(fs::exists(case_folder / "meshing/half.txt"));
  EXPECT_FALSE(fs::exists(case_folder / ".writing-meshing"));
}

TEST_F(Stage, CtrlCLeavesNothingBehindAndEndsWith130) {
  std::array<int, 2> ready{};
  ASSERT_EQ(::pipe(ready.data()), 0);
  run();
  write_file(input, "two");
  const pid_t child = ::fork();
  if (child == 0) {
    handle_interrupts();
    run_stage(case_folder, spec(), common, [&](StageWorkspace& workspace) -> StageVerdict {
      write_file(workspace.folder() / "half.txt", "half");
      char byte = 1;
      if (::write(ready[1], &byte, 1) != 1) ::_exit(1);
      for (;;) ::pause();
    });
  }
  char byte = 0;
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  ::kill(child, SIGINT);
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_EQ(read_file(case_folder / "meshing/od/out.txt"), "made from one");
  EXPECT_FALSE(fs::exists(case_folder / ".writing-meshing"));
}

TEST(Verdict, OfAStageMadeFromAnotherResultIsRefused) {
  const test::TemporaryFolder folder;
  const auto stage = [&](const std::string& name, const std::string& input, const std::string& output,
                         const std::string& text) {
    StageSpec spec;
    spec.stage = name;
    if (!input.empty()) spec.inputs = {{input, folder.path() / input}};
    CommonOptions common;
    common.force = true;
    run_stage(folder.path(), spec, common, [&](StageWorkspace& workspace) -> StageVerdict {
      write_file(workspace.folder() / output, text);
      return {};
    });
  };
  stage("meshing", "", "retina.ply", "one");
  stage("raytrace", "meshing/retina.ply", "eye.json", "traced");
  stage("correction", "raytrace/eye.json", "prescription.json", "corrected");
  EXPECT_EQ(read_verdict(folder.path(), "correction").status, ExitStatus::done);
  stage("meshing", "", "retina.ply", "two");
  for (const char* name : {"raytrace", "correction"}) try {  // correction: through the stage before it
      read_verdict(folder.path(), name);
      ADD_FAILURE() << name << " of another mesh";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find("retina.ply has changed"), std::string::npos) << error.what();
      EXPECT_NE(error.remedy().find("emmetrope trace"), std::string::npos);
    }
  stage("raytrace", "meshing/retina.ply", "eye.json", "traced");  // another mesh, the same light: good
  EXPECT_EQ(read_verdict(folder.path(), "correction").status, ExitStatus::done);

  // Of an edited mesh the mesh is what is stale: the trace, made anew, would refuse it.
  write_file(folder.path() / "meshing/retina.ply", "edited");
  for (const char* name : {"meshing", "raytrace", "correction"}) try {
      read_verdict(folder.path(), name);
      ADD_FAILURE() << name << " of an edited mesh";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find("has been changed since meshing wrote it"), std::string::npos)
          << error.what();
      EXPECT_NE(error.remedy().find("emmetrope mesh"), std::string::npos) << error.remedy();
    }
}

TEST_F(Stage, AnEditedOrRemovedOutputIsRefused) {
  for (const char* name : {"meshing/od/out.txt", "case.json"})
    for (const bool removed : {false, true}) {
      run();
      EXPECT_EQ(read_verdict(case_folder, "meshing").status, ExitStatus::partial);
      if (removed)
        fs::remove(case_folder / name);
      else
        std::ofstream(case_folder / name) << "-99";
      try {
        read_verdict(case_folder, "meshing");
        ADD_FAILURE() << name << " is not what the stage wrote";
      } catch (const Error& error) {
        EXPECT_EQ(error.status(), ExitStatus::input_invalid);
        EXPECT_NE(std::string(error.what()).find((case_folder / name).string()), std::string::npos);
        EXPECT_NE(error.remedy().find("emmetrope mesh"), std::string::npos);
      }
    }
}

/// Another patient's eye in a case that has none would be taken for this one's.
TEST_F(Stage, WhatItDidNotWriteIsRefusedInItsFolder) {
  run();
  write_file(case_folder / "meshing/.DS_Store", "of a desktop");
  EXPECT_EQ(read_verdict(case_folder, "meshing").status, ExitStatus::partial);
  fs::create_directory(case_folder / "meshing/os");
  const fs::path stranger = case_folder / "meshing/os/out.txt";
  write_file(stranger, "of somebody else");
  const auto expect_refusal = [&](const auto& use) {
    try {
      use();
      ADD_FAILURE() << "used";
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      EXPECT_NE(std::string(error.what()).find(stranger.string()), std::string::npos);
    }
  };
  expect_refusal([&] { read_verdict(case_folder, "meshing"); });
  expect_refusal([&] { run(); });
  EXPECT_TRUE(fs::exists(stranger)) << "it may be somebody's work";
  fs::remove(stranger);
  EXPECT_TRUE(run().skipped);
}

TEST_F(Stage, ADamagedStageJsonIsMadeAgain) {
  run();
  for (const char* key : {"warnings", "verdict", "outputs"}) {
    Json stage = read_json(case_folder / "meshing/stage.json");
    stage.erase(key);
    write_json(case_folder / "meshing/stage.json", stage);
    EXPECT_FALSE(run().skipped) << key;
  }
  Json stage = read_json(case_folder / "meshing/stage.json");
  stage["verdict"]["status"] = 99;
  write_json(case_folder / "meshing/stage.json", stage);
  try {
    read_verdict(case_folder, "meshing");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_NE(error.remedy().find("emmetrope mesh"), std::string::npos);
  }
  EXPECT_FALSE(run().skipped);
}

TEST(CaseLock, LeavesAFolderThatIsNoCaseAlone) {
  const test::TemporaryFolder folder;
  EXPECT_THROW(CaseLock(folder.path(), false), Error);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Verdict, OfAMissingStageNamesTheCommandThatMakesIt) {
  const test::TemporaryFolder folder;
  try {
    read_verdict(folder.path(), "meshing");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(error.remedy().find("emmetrope mesh"), std::string::npos);
  }
}

}  // namespace
}  // namespace emmetrope
