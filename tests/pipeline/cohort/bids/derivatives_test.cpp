#include "pipeline/cohort/bids/derivatives.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/files.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/table.hpp"
#include "tests/support/fixture_case.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;
using testing::UnorderedElementsAre;

TEST(Derivatives, LabelsAreNamedAfterTheirImage) {
  EXPECT_EQ(label_name("sub-01_T1w.nii.gz", false), "sub-01_seg-eyes_dseg");
  EXPECT_EQ(label_name("sub-01_ses-2_acq-hi_run-1_T2w.nii", false),
            "sub-01_ses-2_acq-hi_run-1_seg-eyes_dseg");
  EXPECT_EQ(label_name("sub-01_T1w.nii.gz", true), "sub-01_space-T1w_seg-eyes_dseg");
}

class DerivativesOfACase : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(anat());
    for (const char* name : {"sub-01_ses-a_T1w.nii.gz", "sub-01_ses-a_T2w.nii.gz"})
      write_file(anat() / name, name);
    const fs::path case_folder = derivatives_.cohort().case_folder(subject_.id);
    fs::create_directories(case_folder.parent_path());
    test::make_fixture_case(case_folder);
    for (const PipelineStage& stage : pipeline_stages) {
      fs::create_directories(derivatives_.cohort().end_file(subject_.id, stage.command).parent_path());
      write_json(derivatives_.cohort().end_file(subject_.id, stage.command), to_json(StageEnd{0, ""}));
    }
  }
  /// The case was made from these images, both of which show the right eye.
  void fit_to(const std::vector<std::string>& images) const {
    const fs::path case_folder = derivatives_.cohort().case_folder(subject_.id);
    Json json = read_json(case_folder / "case.json");
    json["stacks"] = json["eyes"]["od"]["stacks"] = json["eyes"]["os"]["stacks"] = Json::array();
    for (const std::string& image : images) {
      const std::string name = "stack" + std::to_string(json["stacks"].size() + 1);
      json["stacks"].push_back(
          {{"name", name}, {"uid", "nifti-" + sha256_of_file(anat() / image).substr(0, 16)}});
      json["eyes"]["od"]["stacks"].push_back(name);
      write_file(case_folder / "segmentation" / (name + "_labels.nii.gz"), "labels of " + image);
    }
    write_json(case_folder / "case.json", json);
    write_json(case_folder / "segmentation" / "od" / "fit.json",
               {{"eye", Json::object()}, {"withheld", Json::object()}});
    write_json(case_folder / "segmentation" / "os" / "fit.json", {{"withheld", {{"fit", "no eye"}}}});
  }
  std::vector<std::string> published() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(out() / "sub-01" / "ses-a" / "anat"))
      names.push_back(entry.path().filename().string());
    return names;
  }
  fs::path dataset() const { return temporary_.path() / "dataset"; }
  fs::path anat() const { return dataset() / "sub-01" / "ses-a" / "anat"; }
  fs::path out() const { return dataset() / "derivatives" / "emmetrope"; }

  test::TemporaryFolder temporary_;
  Derivatives derivatives_{temporary_.path() / "dataset" / "derivatives" / "emmetrope"};
  Subject subject_{"sub-01_ses-a", anat(), {}, Json()};
};

TEST_F(DerivativesOfACase, AreItsLabelsItsRowsAndItsReport) {
  fit_to({"sub-01_ses-a_T1w.nii.gz"});
  derivatives_.describe(dataset());
  derivatives_.publish(subject_, dataset());
  EXPECT_THAT(published(),
              UnorderedElementsAre("sub-01_ses-a_seg-eyes_dseg.nii.gz", "sub-01_ses-a_seg-eyes_dseg.json",
                                   "sub-01_ses-a_seg-eyes_dseg.tsv", "sub-01_ses-a_eyes.tsv"));
  const fs::path folder = out() / "sub-01" / "ses-a" / "anat";
  EXPECT_EQ(read_file(folder / "sub-01_ses-a_seg-eyes_dseg.nii.gz"), "labels of sub-01_ses-a_T1w.nii.gz");
  const Json side_car = read_json(folder / "sub-01_ses-a_seg-eyes_dseg.json");
  EXPECT_EQ(side_car.at("Sources"), Json({"bids:raw:sub-01/ses-a/anat/sub-01_ses-a_T1w.nii.gz"}));
  const Table names = read_table(folder / "sub-01_ses-a_seg-eyes_dseg.tsv", {"index", "name"});
  ASSERT_EQ(names.rows.size(), 10U);
  EXPECT_THAT(names.rows.front(), testing::ElementsAre("1", "right cornea"));
  const Table rows = read_table(folder / "sub-01_ses-a_eyes.tsv", {"participant_id", "axial_length"});
  ASSERT_EQ(rows.rows.size(), 2U);
  EXPECT_EQ(rows.cell(0, "outcome"), "measured");
  const Json description = read_json(out() / "dataset_description.json");
  EXPECT_EQ(description.at("DatasetType"), "derivative");
  EXPECT_EQ(description.at("DatasetLinks").at("raw"), "../..");
}

TEST_F(DerivativesOfACase, OfTwoContrastsHaveTheirNames) {
  fit_to({"sub-01_ses-a_T1w.nii.gz", "sub-01_ses-a_T2w.nii.gz"});
  derivatives_.publish(subject_, dataset());
  const std::vector<std::string> names = published();
  EXPECT_THAT(names, testing::Contains("sub-01_ses-a_space-T1w_seg-eyes_dseg.nii.gz"));
  EXPECT_THAT(names, testing::Contains("sub-01_ses-a_space-T2w_seg-eyes_dseg.nii.gz"));
  EXPECT_EQ(names.size(), 7U);
  fit_to({"sub-01_ses-a_T1w.nii.gz"});
  derivatives_.publish(subject_, dataset());
  EXPECT_EQ(published().size(), 4U);  // nothing is left of before
}

TEST_F(DerivativesOfACase, OfNoFittedEyeAreItsRowsAlone) {
  fit_to({"sub-01_ses-a_T1w.nii.gz"});
  write_json(derivatives_.cohort().case_folder(subject_.id) / "segmentation" / "od" / "fit.json",
             {{"eye", Json::object()}, {"withheld", {{"fit", "fat was taken for its wall"}}}});
  derivatives_.publish(subject_, dataset());
  EXPECT_THAT(published(), UnorderedElementsAre("sub-01_ses-a_eyes.tsv"));
}

}  // namespace
}  // namespace emmetrope::cohort
