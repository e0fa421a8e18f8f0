// The command itself: status, one JSON document on standard output, nothing of the patient's.
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>

#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

struct Outcome {
  int status;
  std::string out;
};

Outcome inventory_of(const std::string& arguments) {
  const char* bin = std::getenv("EMMETROPE_BIN");
  if (bin == nullptr) throw std::runtime_error("EMMETROPE_BIN is not set; run by ctest");
  std::FILE* pipe = ::popen((std::string(bin) + "/emmetrope-inventory " + arguments + " 2>&1").c_str(), "r");
  Outcome outcome{0, {}};
  for (int letter = std::fgetc(pipe); letter != EOF; letter = std::fgetc(pipe))
    outcome.out += static_cast<char>(letter);
  outcome.status = WEXITSTATUS(::pclose(pipe));
  return outcome;
}

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

}  // namespace
}  // namespace emmetrope::test
