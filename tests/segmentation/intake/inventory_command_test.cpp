// The command itself: status, one JSON document on standard output, nothing of the patient's.
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "pipeline/base/sanitizers.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

struct Outcome {
  int status;
  std::string out;
};

Outcome run(const std::string& command) {
  std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  Outcome outcome{0, {}};
  for (int letter = std::fgetc(pipe); letter != EOF; letter = std::fgetc(pipe))
    outcome.out += static_cast<char>(letter);
  outcome.status = WEXITSTATUS(::pclose(pipe));
  return outcome;
}

std::string programs() {
  const char* bin = std::getenv("EMMETROPE_BIN");
  if (bin == nullptr) throw std::runtime_error("EMMETROPE_BIN is not set; run by ctest");
  return bin;
}

Outcome inventory_of(const std::string& arguments) {
  return run(programs() + "/emmetrope-inventory " + arguments);
}

/// The decoder's own limits do not fail where lower ones stand; where it cannot work under them, no file is blamed.
#ifndef EMMETROPE_UNDER_SANITIZER
TEST_F(IntakeTest, CommandReadsUnderAMemoryLimitOrSaysThatItIsTooLow) {
  GeneratedSeries series;
  series.write(folder());
  const auto inventory_under_limit = [&](const std::string& bin) {
    return run("ulimit -v 700000; " + bin + "/emmetrope-inventory --quiet --json " + folder().string());
  };
  const Outcome enough = inventory_under_limit(programs());
  EXPECT_EQ(enough.status, 0) << enough.out;
  EXPECT_TRUE(Json::parse(enough.out).at("series").at(0).at("usable").get<bool>());

  const TemporaryFolder bin;
  const std::filesystem::path inventory = bin.path() / "emmetrope-inventory",
                              decode = bin.path() / "emmetrope-decode";
  std::filesystem::copy_file(programs() + "/emmetrope-inventory", inventory);
  std::ofstream(decode) << "#!/bin/sh\nexit 127\n";
  std::filesystem::permissions(decode, std::filesystem::perms::owner_all);
  const Outcome too_little = inventory_under_limit(bin.path().string());
  EXPECT_EQ(too_little.status, 1);
  EXPECT_THAT(too_little.out, ::testing::AllOf(::testing::HasSubstr("emmetrope-decode does not start"),
                                               ::testing::HasSubstr("ulimit -v")));
}
#endif

TEST_F(IntakeTest, CommandListsAStudyAsJson) {
  GeneratedSeries series;
  series.write(folder());
  const auto outcome = inventory_of("--quiet --json " + folder().string());
  EXPECT_EQ(outcome.status, 0);
  const Json json = Json::parse(outcome.out);
  const auto& info = json.at("series").at(0);
  for (const auto* key : {"uid",
                          "description",
                          "modality",
                          "files",
                          "rows",
                          "columns",
                          "row_spacing_mm",
                          "column_spacing_mm",
                          "slice_spacing_mm",
                          "uniform",
                          "orientation",
                          "first_position_mm",
                          "last_position_mm",
                          "min",
                          "max",
                          "mean",
                          "transfer_syntax",
                          "warnings",
                          "usable",
                          "reason"})
    EXPECT_TRUE(info.contains(key)) << key;
  EXPECT_EQ(info.at("orientation").size(), 6U);
  EXPECT_TRUE(json.at("skipped").is_array());
  EXPECT_THAT(outcome.out, Not(::testing::HasSubstr("SECRET")));
}

TEST_F(IntakeTest, CommandSaysWhyNothingIsUsable) {
  GeneratedSeries series;
  series.set_all(DCM_PixelSpacing, "0\\0");
  series.write(folder());
  const auto outcome = inventory_of(folder().string());
  EXPECT_EQ(outcome.status, 3);
  EXPECT_THAT(outcome.out, ::testing::HasSubstr("(0028,0030)"));
  series.set_all(DCM_PixelSpacing, "0.5\\0.4");
  series.set_all(DCM_Modality, "CT");
  series.write(folder());
  EXPECT_EQ(inventory_of(folder().string()).status, 4);
  EXPECT_EQ(inventory_of("/nonexistent").status, 3);
  EXPECT_EQ(inventory_of("").status, 2);
}

/// As `segment` ends that refuses them.
TEST_F(IntakeTest, CommandFindsNothingUsableInPartsOfASignal) {
  GeneratedSeries fat, opposed("1.2.826.0.1.3680043.9.7.5", 2), whole("1.2.826.0.1.3680043.9.7.6", 3);
  fat.set_all(DCM_ImageType, "DERIVED\\PRIMARY\\DIXON\\FAT");
  opposed.set_all(DCM_ImageType, "ORIGINAL\\PRIMARY\\DIXON\\OPP_PHASE");
  fat.write(folder() / "fat");
  opposed.write(folder() / "opposed");
  const auto outcome = inventory_of(folder().string());
  EXPECT_EQ(outcome.status, 4);
  EXPECT_THAT(
      outcome.out,
      ::testing::AllOf(::testing::HasSubstr("NOT usable: (0008,0008) ImageType says that it shows fat"),
                       ::testing::HasSubstr("stack2: not usable: (0008,0008) ImageType says that water")));
  const auto of_json = [&](const std::string& more) {
    const std::string out = inventory_of("--quiet --json " + folder().string() + more).out;
    return Json::parse(out.substr(out.find('{'))).at("series");  // warnings stand before it
  };
  EXPECT_FALSE(of_json("").at(0).at("usable").get<bool>());
  EXPECT_THAT(of_json("").at(0).at("reason").get<std::string>(), ::testing::HasSubstr("only where --series"));
  // What the user names is used.
  const std::string named = " --series 1.2.826.0.1.3680043.9.7.1";
  EXPECT_EQ(inventory_of("--quiet " + folder().string() + named).status, 0);
  EXPECT_TRUE(of_json(named).at(0).at("usable").get<bool>());
  EXPECT_FALSE(of_json(named).at(1).at("usable").get<bool>());
  whole.write(folder() / "whole");
  EXPECT_EQ(inventory_of("--quiet " + folder().string()).status, 0);
}

}  // namespace
}  // namespace emmetrope::test
