// Real runs of emmetrope eye and trace, against what these commands say when they are called by hand.
#include "pipeline/cohort/sweep/sweep.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/cohort/subjects/table.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

class SweepOfEyes : public testing::Test {
 protected:
  void SetUp() override {
    if (!find_program("snakemake")) GTEST_SKIP() << "snakemake is not installed";
  }
  ProcessResult run(const std::string& text) const {
    write_file(folder() / "sweep.toml", text);
    return run_process(
        bin() / "emmetrope-sweep",
        {(folder() / "sweep.toml").string(), "-o", (folder() / "out").string(), "--json", "--quiet"},
        ChildOutput::capture);
  }
  Json by_hand(const std::string& command, const std::vector<std::string>& words) const {
    return Json::parse(run_process(bin() / ("emmetrope-" + command), words, ChildOutput::capture).output);
  }
  Table table() const { return read_table(folder() / "out" / "sweep.tsv", {"run", "status"}); }
  static fs::path bin() { return std::getenv("EMMETROPE_BIN"); }
  const fs::path& folder() const { return temporary_.path(); }
  test::TemporaryFolder temporary_;
};

TEST_F(SweepOfEyes, IsWhatTheCommandSaysOfEach) {
  const std::string text =
      "command = 'eye'\n[vary]\neye = ['navarro', 'no-such-eye', 'le-grand']\naccommodation = [0, 2]\n";
  const ProcessResult ended = run(text);
  EXPECT_EQ(ended.status, 8) << ended.output;
  const Table found = table();
  ASSERT_EQ(found.rows.size(), 6U);
  const Json hand = by_hand("eye", {"navarro", "--accommodation", "2", "--json", "--quiet"});
  EXPECT_EQ(found.cell(1, "eye"), "navarro");
  EXPECT_EQ(found.cell(1, "accommodation"), "2");
  EXPECT_NEAR(std::stod(found.cell(1, "power_D")), hand.at("power_D").get<double>(), 1e-6);
  EXPECT_NEAR(std::stod(found.cell(1, "refraction_M_D")), -2, 0.01);
  EXPECT_EQ(found.cell(2, "status"), "2");
  EXPECT_THAT(found.cell(2, "message"), testing::HasSubstr("no-such-eye"));
  EXPECT_EQ(found.cell(2, "power_D"), "");

  // More values: only what is new is done.
  const auto end = folder() / "out" / "ends" / (found.cell(0, "run") + ".json");
  const auto before = fs::last_write_time(end);
  run("command = 'eye'\n[vary]\neye = ['arizona', 'navarro']\naccommodation = [0, 2]\n");
  const Table more = table();
  ASSERT_EQ(more.rows.size(), 4U);
  EXPECT_EQ(more.cell(2, "run"), found.cell(0, "run"));
  EXPECT_EQ(fs::last_write_time(end), before);
}

TEST_F(SweepOfEyes, WhatACommandWarnsOfIsInItsRow) {
  run("command = 'eye'\n[vary]\neye = ['liou-brennan']\nwavelength = [555, 2400]\n");
  const Table found = table();
  ASSERT_EQ(found.rows.size(), 2U);
  EXPECT_EQ(found.cell(0, "message"), "");
  EXPECT_EQ(found.cell(1, "status"), "0");
  EXPECT_THAT(found.cell(1, "message"), testing::HasSubstr("warning: "));
  EXPECT_THAT(found.cell(1, "message"), testing::HasSubstr("extrapolated"));
}

TEST_F(SweepOfEyes, AColumnIsNotCalledAsANumberIs) {
  const ProcessResult ended =
      run("command = 'eye'\n[vary]\neye = ['navarro', 'le-grand']\n[columns]\nrefraction_M_D = '/power_D'\n");
  EXPECT_EQ(ended.status, 3);
  EXPECT_THAT(ended.output,
              testing::HasSubstr("[columns] refraction_M_D: the table has that column already"));
}

TEST_F(SweepOfEyes, ColumnsThatCannotBeLeaveTheTableAllElse) {
  const ProcessResult ended = run(
      "command = 'eye'\n[vary]\neye = ['navarro']\n[columns]\nall = '/refraction'\ncoma = '/refraction/coma'\n"
      "M = '/refraction/M_D'\n");
  EXPECT_EQ(ended.status, 3);
  EXPECT_THAT(ended.output, testing::HasSubstr("[columns] all: /refraction is an object"));
  EXPECT_THAT(ended.output, testing::HasSubstr("[columns] coma: no result has /refraction/coma"));
  EXPECT_EQ(table().cell(0, "M"), table().cell(0, "refraction_M_D"));
}

/// An eye that looks like an option is a file that is not there.
TEST_F(SweepOfEyes, NeitherAnEyeNorAColumnBreaksTheTable) {
  const ProcessResult ended = run(
      "command = 'eye'\n[vary]\neye = ['navarro', '-h', '--version']\n[columns]\n\"a\\tb\" = '/power_D'\n");
  EXPECT_EQ(ended.status, 8) << ended.output;
  const Table found = table();
  ASSERT_EQ(found.rows.size(), 3U);
  EXPECT_EQ(found.cell(0, "a b"), found.cell(0, "power_D"));
  EXPECT_EQ(found.cell(1, "status"), "2");
  EXPECT_EQ(found.cell(2, "status"), "2");
}

TEST_F(SweepOfEyes, AnOptionThatTheCommandDoesNotHaveStartsNoRun) {
  const ProcessResult ended = run("command = 'eye'\n[all]\npupils = 3\n[vary]\neye = ['navarro']\n");
  EXPECT_EQ(ended.status, 3);
  EXPECT_THAT(ended.output, testing::HasSubstr("sweep.toml: pupils is no option of emmetrope eye"));
  EXPECT_FALSE(fs::exists(folder() / "out" / "ends"));
}

// As words of a command line the first would take the next option for its value, the last 2 for a case.
TEST_F(SweepOfEyes, ValuesThatAnOptionDoesNotTakeStartNoRun) {
  for (const auto& [setting, said] :
       {std::pair("pupil = true", "pupil needs a value, found none"),
        {"achromatic = 3", "achromatic takes no value, found 3"},
        {"fovea = [1, 2]", "fovea takes one value, found a list of several: 1 2"}}) {
    const ProcessResult ended =
        run("command = 'trace'\n[all]\n" + std::string(setting) + "\n[vary]\neye = ['navarro']\n");
    EXPECT_EQ(ended.status, 3);
    EXPECT_THAT(ended.output, testing::HasSubstr(said));
    EXPECT_FALSE(fs::exists(folder() / "out"));
  }
}

TEST_F(SweepOfEyes, AColumnThatNoResultHasStartsNoRun) {
  for (const auto& [column, said] :
       {std::pair("coma = '/coma/um'", "[columns] coma: a result of emmetrope eye has no key \\\"coma\\\""),
        {"power_D = '/refraction_D'", "[columns] power_D: the result has a power_D of its own"}}) {
    const ProcessResult ended = run("command = 'eye'\n[vary]\neye = ['navarro', 'le-grand']\n[columns]\n" +
                                    std::string(column) + "\n");
    EXPECT_EQ(ended.status, 3);
    EXPECT_THAT(ended.output, testing::HasSubstr(said));
    EXPECT_FALSE(fs::exists(folder() / "out"));
  }
}

// By which columns are refused before the runs.
TEST_F(SweepOfEyes, ResultsHaveTheKeysThatTheirCommandsTell) {
  const auto keys_of = [](const Json& result) {
    std::vector<std::string> keys;
    for (const auto& [key, value] : result.items()) keys.push_back(key);
    return keys;
  };
  const auto told = [&](const std::string& command) {
    return by_hand(command, {"--definition"}).at("result_keys").get<std::vector<std::string>>();
  };
  const std::string out = (folder() / "out").string();
  auto of_answer = told("eye");
  of_answer.emplace_back("status");  // as every answer
  EXPECT_THAT(keys_of(by_hand("eye", {"navarro", "--json"})), testing::UnorderedElementsAreArray(of_answer));
  by_hand("trace", {"--eye", "navarro", "--size", "8x8", "--samples", "1", "-o", out, "--json", "--quiet"});
  EXPECT_THAT(keys_of(read_json(folder() / "out/wavefront.json")),
              testing::UnorderedElementsAreArray(told("trace")));
  by_hand("correct", {"--eye", "navarro", "--samples", "1", "-o", out, "--json", "--quiet"});
  EXPECT_THAT(keys_of(read_json(folder() / "out/prescription.json")),
              testing::UnorderedElementsAreArray(told("correct")));
}

TEST_F(SweepOfEyes, TracesAreNumbersOfTheirWavefronts) {
  const ProcessResult ended =
      run("command = 'trace'\n[all]\neye = 'navarro'\nsize = '32x32'\nsamples = 32\nachromatic = true\n"
          "[vary]\npupil = [2, 4]\n[columns]\nspherical_um = '/zernike_um/12'\n");
  ASSERT_EQ(ended.status, 0) << ended.output;
  const Table found = table();
  ASSERT_EQ(found.rows.size(), 2U);
  const double small = std::stod(found.cell(0, "spherical_um")),
               large = std::stod(found.cell(1, "spherical_um"));
  EXPECT_GT(small, 0);
  EXPECT_GT(large / small, 12);  // the fourth power of the pupil, and more by higher orders
  EXPECT_LT(large / small, 20);
  EXPECT_EQ(found.cell(0, "pupil"), "2");
  EXPECT_TRUE(fs::exists(folder() / "out" / "results" / found.cell(0, "run") / "wavefront.json"));
}

}  // namespace
}  // namespace emmetrope::cohort
