// The sample study in data_samples/ and the tables in docs/method/phantom.md against the code.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "data_samples/phantom/phantom.hpp"
#include "data_samples/phantom/population.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope::phantom {
namespace {

namespace fs = std::filesystem;

TEST(Sample, IsSmallAndSaysThatItIsSynthetic) {
  const fs::path sample = data_folder() / "data_samples/sample";
  std::uintmax_t bytes = 0;
  int images = 0;
  for (const auto& entry : fs::recursive_directory_iterator(sample))
    if (entry.is_regular_file()) {
      bytes += entry.file_size();
      images += entry.path().extension() == ".dcm" ? 1 : 0;
    }
  EXPECT_LE(bytes, 6'000'000U);
  EXPECT_EQ(images, 64);
  EXPECT_TRUE(read_file(sample / "README.md").find("synthetic") != std::string::npos);
}

TEST(Sample, TruthIsThatOfTheGeometryInTheCode) {
  const Json stored = read_json(data_folder() / "data_samples/sample/truth.json");
  const Json now = truth(sample_head());
  EXPECT_EQ(stored["synthetic"], true);
  EXPECT_EQ(stored["head"], now["head"]);
  for (const char* eye : {"od", "os"})
    for (const auto& [key, value] : now["eyes"][eye].items())
      EXPECT_TRUE(stored["eyes"][eye].contains(key)) << key;
}

TEST(Documentation, ListsEveryTissueWithItsSignals) {
  const std::string page = read_file(data_folder() / "docs/method/phantom.md");
  for (const TissueProperties& tissue : tissue_table()) {
    const std::string row = fmt::format("| {} | {:.2f} | {:.2f} | {} |", tissue.name, tissue.signal_T1,
                                        tissue.signal_T2, tissue.is_fat ? "yes" : "");
    EXPECT_TRUE(page.find(row) != std::string::npos) << row;
  }
}

TEST(Documentation, ListsThePopulation) {
  const std::string page = read_file(data_folder() / "docs/method/phantom.md");
  for (const Distribution& d : population()) {
    const std::string row =
        fmt::format("| {} | {} | {} | {} | {} to {} | {} |", d.name, d.mean,
                    d.per_year == 0 ? "" : fmt::format("{:+}", d.per_year), d.sd, d.low, d.high, d.source);
    EXPECT_TRUE(page.find(row) != std::string::npos) << row;
  }
}

TEST(Documentation, ListsEveryGeometryKey) {
  const std::string page = read_file(data_folder() / "docs/use/phantom.md");
  for (const auto& names : {eye_field_names(), head_field_names()})
    for (const std::string& name : names)
      EXPECT_TRUE(page.find("`" + name + "`") != std::string::npos) << name;
}

}  // namespace
}  // namespace emmetrope::phantom
