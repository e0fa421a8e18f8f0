#include "pipeline/cohort/sweep/sweep_run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

TEST(SweepPlan, OfWhatASceneNamesIsAPartOfIt) {
  const test::TemporaryFolder folder;
  const fs::path scene = folder.path() / "scene.json", picture = folder.path() / "a.png";
  write_file(picture, "a picture");
  write_json(scene, {{"objects", {{{"picture", "a.png"}}}}});
  const Sweep sweep{"trace", {}, {{{"scene", scene.string(), {"--scene=" + scene.string()}}}}, {}};
  const Json before = sweep_plan(sweep, sweep.runs[0], {"--seed", "1"});
  EXPECT_EQ(before.at("files").size(), 2U);
  write_file(picture, "another picture");
  EXPECT_NE(run_name(sweep_plan(sweep, sweep.runs[0], {"--seed", "1"})), run_name(before));
}

// Zemax's glasses, a model's materials.
TEST(SweepPlan, OfWhatIsReadBesideAFileIsAPartOfIt) {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "lens.zmx", "a lens");
  write_file(folder.path() / "lens.agf", "a glass");
  write_file(folder.path() / "notes.txt", "notes");
  const std::string lens = (folder.path() / "lens.zmx").string();
  const Sweep sweep{"eye", {}, {{{"eye", lens, {"--eye=" + lens}}}}, {}};
  const Json before = sweep_plan(sweep, sweep.runs[0], {});
  EXPECT_EQ(before.at("files").size(), 2U);
  write_file(folder.path() / "lens.agf", "another glass");
  EXPECT_NE(run_name(sweep_plan(sweep, sweep.runs[0], {})), run_name(before));
}

TEST(SweepPlan, WhatTheSweepSetsIsNotSetAgain) {
  const Sweep sweep{"trace", {}, {{{"seed", "7", {"--seed=7"}}}}, {}};
  const Json plan = sweep_plan(sweep, sweep.runs[0], {"--seed", "1", "--device", "0"});
  EXPECT_THAT(plan.at("words").get<std::vector<std::string>>(), ElementsAre("--seed=7", "--device", "0"));
}

}  // namespace
}  // namespace emmetrope::cohort
