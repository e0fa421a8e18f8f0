#include "segmentation/intake/sidecar_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::test {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;

class SidecarFiles : public ::testing::Test {
 protected:
  void add(const fs::path& file) const {
    fs::create_directories((folder_.path() / file).parent_path());
    write_file(folder_.path() / file, "{}");
  }
  /// Relative to the dataset.
  std::vector<std::string> of(const fs::path& volume) const {
    std::vector<std::string> files;
    for (const fs::path& file : segmentation::sidecars_of(folder_.path() / volume))
      files.push_back(file.lexically_relative(folder_.path()).string());
    return files;
  }

 private:
  TemporaryFolder folder_;
};

/// The inheritance principle of BIDS.
TEST_F(SidecarFiles, OfADatasetAreThoseOfItsFoldersThatApply) {
  for (const char* file :
       {"T1w.json", "acq-fast_T1w.json", "acq-slow_T1w.json", "task-rest_bold.json", "sub-01/sub-01_T1w.json",
        "sub-01/ses-a/sub-01_ses-a_T2w.json", "sub-01/ses-a/anat/sub-01_ses-a_T1w.json"})
    add(file);
  const char* own = "sub-01/ses-a/anat/sub-01_ses-a_T1w";
  EXPECT_THAT(of(std::string(own) + ".nii.gz"), ElementsAre(std::string(own) + ".json"));  // of no dataset
  add("dataset_description.json");
  EXPECT_THAT(of(std::string(own) + ".nii.gz"),
              ElementsAre(std::string(own) + ".json", "sub-01/sub-01_T1w.json", "T1w.json"));
  // Of several in a folder the one that says most; without a sidecar of its own one beside it applies too.
  EXPECT_THAT(of("sub-01/ses-a/anat/sub-01_ses-a_acq-fast_T1w.nii"),
              ElementsAre(std::string(own) + ".json", "sub-01/sub-01_T1w.json", "acq-fast_T1w.json"));
  add("sub-01/ses-a/anat/sub-01_ses-a_acq-fast_T1w.json");
  EXPECT_THAT(of("sub-01/ses-a/anat/sub-01_ses-a_acq-fast_T1w.nii"),
              ElementsAre("sub-01/ses-a/anat/sub-01_ses-a_acq-fast_T1w.json", "sub-01/sub-01_T1w.json",
                          "acq-fast_T1w.json"));
  EXPECT_THAT(of("sub-02/anat/sub-02_T2w.nii"), ElementsAre());
  EXPECT_THAT(of("sub-02/anat/sub-02_T1w.nii"), ElementsAre("T1w.json"));
  EXPECT_THAT(of("sub-02/anat/T1w.nii"), ElementsAre());  // not named as BIDS names images
}

}  // namespace
}  // namespace emmetrope::test
