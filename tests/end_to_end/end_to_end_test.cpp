// A study from DICOM to report with the real stages, and what happens to a run that is killed in each of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <thread>

#include "pipeline/base/files.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/base/process.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string>& stages() {
  static const std::vector<std::string> names{"segmentation", "meshing", "raytrace", "correction", "report"};
  return names;
}

fs::path program() { return fs::path(std::getenv("EMMETROPE_BIN")) / "emmetrope"; }
fs::path sample() { return data_folder() / "data_samples" / "sample" / "dicom"; }

std::vector<std::string> run_words(const fs::path& study, const fs::path& case_folder,
                                   const std::vector<std::string>& more) {
  std::vector<std::string> words{"run", study.string(), "-o", case_folder.string(), "--quiet", "--json"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// Bytes of every file that must not depend on how a run went.
std::map<std::string, std::string> contents(const fs::path& case_folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(case_folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_regular_file() && name != "stage.json" && name != ".lock")
      files[fs::relative(entry.path(), case_folder).string()] = sha256_of_file(entry.path());
  }
  return files;
}

/// Starts a run, waits until it works on `stage` and kills it with all its children, as a power cut would.
void kill_in(const std::string& stage, const fs::path& case_folder, std::vector<std::string> words) {
  words.insert(words.begin(), program().string());
  std::vector<char*> pointers;
  for (auto& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    ::setpgid(0, 0);
    ::execv(pointers[0], pointers.data());
    ::_exit(127);
  }
  ::setpgid(child, child);
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(5);
  while (!fs::exists(case_folder / (".writing-" + stage)) && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  ASSERT_TRUE(fs::exists(case_folder / (".writing-" + stage))) << stage << " was never reached";
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  ::kill(-child, SIGKILL);
  ::waitpid(child, nullptr, 0);
}

TEST(EndToEnd, SampleStudyGivesAReportOfBothEyesAsTheyAre) {
  const test::TemporaryFolder folder;
  const fs::path case_folder = folder.path() / "case";
  const ProcessResult first =
      run_process(program(), run_words(sample(), case_folder, {}), ChildOutput::capture);
  ASSERT_EQ(first.status, 0) << first.output;
  const Json answer = Json::parse(first.output);
  for (const auto& stage : answer["stages"]) EXPECT_LE(stage["peak_memory_MB"], 2048) << stage;

  for (const char* file : {"case.json", "report/report.html", "report/report.pdf", "report/report.dcm"})
    EXPECT_TRUE(fs::exists(case_folder / file)) << file;
  for (const char* eye : {"od", "os"}) {
    for (const char* file :
         {"segmentation/EYE/boundary.ply", "segmentation/EYE/fit.json", "meshing/EYE/biometry.json",
          "meshing/EYE/cornea_anterior.ply", "meshing/EYE/cornea_posterior.ply",
          "meshing/EYE/lens_anterior.ply", "meshing/EYE/lens_posterior.ply", "meshing/EYE/retina.ply",
          "raytrace/EYE/eye.json", "raytrace/EYE/uncorrected.png", "raytrace/EYE/wavefront.json",
          "correction/EYE/prescription.json", "correction/EYE/corrected.png", "correction/EYE/sweep.csv"}) {
      std::string name = file;
      name.replace(name.find("EYE"), 3, eye);
      EXPECT_TRUE(fs::exists(case_folder / name)) << name;
    }
  }
  // What was measured is what the study was made from.
  const Json truth = read_json(sample().parent_path() / "truth.json").at("eyes");
  for (const char* eye : {"od", "os"}) {
    const Json biometry = read_json(case_folder / "meshing" / eye / "biometry.json");
    for (const auto& [quantity, largest_error] : {std::pair{"/axial_length_mm", 0.12},
                                                  {"/anterior_chamber_depth_mm", 0.08},
                                                  {"/lens_thickness_mm", 0.08},
                                                  {"/globe_width_mm", 0.1},
                                                  {"/globe_height_mm", 0.1},
                                                  {"/astigmatism/M_D", 1.5},
                                                  {"/astigmatism/J0_D", 0.7},
                                                  {"/astigmatism/J45_D", 0.7}}) {
      const Json::json_pointer at(quantity);
      const auto measured = biometry.at(at).get<Measured>();
      const double error = measured.value - truth.at(eye).at(at).get<double>();
      EXPECT_LT(std::abs(error), largest_error) << eye << quantity;
      EXPECT_LT(std::abs(error), 3 * measured.sigma()) << eye << quantity;
    }
    EXPECT_LT(biometry.at("astigmatism").at("M_D").get<Measured>().sigma(), 1.1) << eye;
  }
  for (const auto& stage : stages()) {
    const Json provenance = read_json(case_folder / stage / "stage.json");
    for (const char* key : {"version", "command_line", "parameters", "seed", "inputs", "outputs",
                            "opencl_device", "wall_s", "warnings", "verdict"})
      EXPECT_TRUE(provenance.contains(key)) << stage << " " << key;
  }

  // A second run finds everything done.
  const ProcessResult second =
      run_process(program(), run_words(sample(), case_folder, {}), ChildOutput::capture);
  EXPECT_EQ(second.status, 0);
  for (const auto& stage : Json::parse(second.output)["stages"])
    EXPECT_TRUE(stage["skipped"].get<bool>()) << stage;
}

/// Of one eye in a small study, which takes half as long as the sample.
TEST(EndToEnd, ARunThatIsKilledInEveryStageEndsWithTheSameReport) {
  const test::TemporaryFolder folder;
  const fs::path phantom = folder.path() / "phantom", straight = folder.path() / "straight",
                 killed = folder.path() / "killed";
  ASSERT_EQ(run_process(program(),
                        {"phantom", "-o", phantom.string(), "--random", "7", "--snr", "20", "--stack",
                         "head-axial:pixel_mm=0.8,slice_mm=0.8,matrix=140x60,slices=44"},
                        ChildOutput::discard)
                .status,
            0);
  const auto words = [&](const fs::path& case_folder) {
    return run_words(phantom / "dicom", case_folder, {"--laterality", "od"});
  };
  ASSERT_EQ(run_process(program(), words(straight), ChildOutput::discard).status, 0);
  for (const auto& stage : stages()) kill_in(stage, killed, words(killed));
  ASSERT_EQ(run_process(program(), words(killed), ChildOutput::discard).status, 0);
  EXPECT_THAT(contents(killed), testing::ContainerEq(contents(straight)));
}

}  // namespace
}  // namespace emmetrope
