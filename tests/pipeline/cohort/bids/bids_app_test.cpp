#include "pipeline/cohort/bids/bids_app.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/cohort/subjects/table.hpp"
#include "tests/support/fixture_case.hpp"
#include "tests/support/stand_in_stages.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class BidsApp : public testing::Test {
 protected:
  void SetUp() override {
    for (const char* image : {"sub-01/anat/sub-01_T1w.nii.gz", "sub-02/ses-a/anat/sub-02_ses-a_T1w.nii.gz",
                              "sub-02/ses-b/anat/sub-02_ses-b_T1w.nii.gz"}) {
      fs::create_directories((dataset() / image).parent_path());
      write_file(dataset() / image, image);
    }
    write_file(dataset() / "dataset_description.json", "{}");
    write_file(dataset() / "participants.tsv", "participant_id\tage\nsub-01\t30\nsub-02\t40\nsub-03\t50\n");
  }
  ProcessResult run(std::vector<std::string> words) const {
    words.insert(words.begin(), {dataset().string(), out().string()});
    words.insert(words.end(), {"--json", "--quiet"});
    return stages_.run("bids", words);
  }
  /// What a run warns of, a line each.
  std::string warnings(const std::vector<std::string>& words) const {
    const Json answer = Json::parse(run(words).output);
    std::string all;
    for (const Json& warning : answer.value("warnings", Json::array()))
      all += warning.get<std::string>() + "\n";
    return all;
  }
  fs::path dataset() const { return temporary_.path() / "dataset"; }
  fs::path out() const { return dataset() / "derivatives" / "emmetrope"; }
  test::TemporaryFolder temporary_;
  test::StandInStages stages_{temporary_.path()};
};

TEST_F(BidsApp, MeasuresTheParticipantsThatAreAskedForAndThenTheGroup) {
  stages_.tell("sub-02_ses-a", "segment", "3");
  EXPECT_EQ(run({"participant", "--participant-label", "sub-01/"}).status, 0);
  EXPECT_EQ(stages_.runs().size(), 5U);
  EXPECT_EQ(run({"participant", "--participant_label", "sub-02", "--session-label", "a", "b"}).status, 0);
  EXPECT_EQ(stages_.runs().at("segment sub-02_ses-b"), 1);
  EXPECT_TRUE(fs::exists(out() / "sub-02" / "ses-a" / "anat" / "sub-02_ses-a_eyes.tsv"));
  EXPECT_FALSE(fs::exists(out() / "cohort.tsv"));
  EXPECT_EQ(read_json(out() / "emmetrope" / "subjects" / "sub-01.json").at("options").at("segment").at(1),
            "30");

  // One that is being measured just now.
  write_file(out() / "emmetrope" / "subjects" / "sub-09.json", "{}");
  fs::rename(dataset() / "sub-01", temporary_.path() / "taken away");  // the group needs no images
  const ProcessResult group = run({"group"});
  EXPECT_EQ(group.status, 0) << group.output;
  const Table table = read_table(out() / "cohort.tsv", {"participant_id", "reason"});
  ASSERT_EQ(table.rows.size(), 6U);
  EXPECT_EQ(table.cell(0, "participant_id"), "sub-01");
  EXPECT_EQ(table.cell(2, "outcome"), "failed");
  EXPECT_EQ(table.cell(2, "reason"), "told by segment");
  EXPECT_TRUE(fs::exists(out() / "cohort.html"));
}

TEST_F(BidsApp, AllAreMeasuredWhereNobodyIsNamed) {
  EXPECT_EQ(run({"participant"}).status, 0);
  EXPECT_EQ(stages_.runs().size(), 15U);
}

// The table of participants is the owner's, and may have changed since.
TEST_F(BidsApp, SaysWhereTheTableOfParticipantsSaysOtherwise) {
  EXPECT_THAT(warnings({"participant"}), HasSubstr("there is no study of \"sub-03\""));
  EXPECT_EQ(warnings({"group"}), "");
  write_file(dataset() / "participants.tsv", "participant_id\tage\nsub-01\t31\n");
  const std::string group = warnings({"group"});
  EXPECT_THAT(group, HasSubstr("line 2, column age: \"31\"; sub-01 was measured as of \"30\""));
  EXPECT_THAT(group, HasSubstr("sub-02_ses-a has no row"));
  EXPECT_THAT(warnings({"participant", "--participant-label", "02"}), HasSubstr("sub-02_ses-b has no row"));
}

/// Stages of two plans are of no eye.
TEST_F(BidsApp, AVisitThatIsHalfMeasuredAnewIsNotFinished) {
  EXPECT_EQ(run({"participant"}).status, 0);
  write_file(dataset() / "participants.tsv", "participant_id\tage\nsub-01\t31\n");
  stages_.tell("sub-01", "trace", "kill");
  EXPECT_NE(run({"participant", "--participant-label", "01"}).status, 0);
  EXPECT_THAT(warnings({"group"}), HasSubstr("1 visits are left out"));
  const Table table = read_table(out() / "cohort.tsv", {"participant_id"});
  EXPECT_EQ(table.cell(0, "participant_id"), "sub-02_ses-a");
  stages_.forget("sub-01", "trace");
  EXPECT_EQ(run({"participant", "--participant-label", "01"}).status, 0);
  EXPECT_THAT(warnings({"group"}), testing::Not(HasSubstr("left out")));
}

TEST_F(BidsApp, ABrokenFileLeavesOneVisitOut) {
  EXPECT_EQ(run({"participant"}).status, 0);
  write_file(out() / "emmetrope" / "ends" / "sub-01" / "mesh.json", "{ broken");
  EXPECT_THAT(warnings({"group"}), HasSubstr("1 visits are left out"));
  write_file(out() / "emmetrope" / "subjects" / "sub-02_ses-a.json", "{ broken");
  EXPECT_THAT(warnings({"group"}), HasSubstr("2 visits are left out"));
  EXPECT_EQ(read_table(out() / "cohort.tsv", {}).cell(0, "participant_id"), "sub-02_ses-b");
}

TEST_F(BidsApp, WarnsOfASexThatIsNone) {
  write_file(dataset() / "participants.tsv", "participant_id\tsex\nsub-01\tW\nsub-02\tn/a\n");
  const std::string said = warnings({"participant"});
  EXPECT_THAT(said, HasSubstr("participants.tsv: line 2, column sex: \"W\" is none of"));
  EXPECT_THAT(said, testing::Not(HasSubstr("line 3")));
}

TEST_F(BidsApp, WarnsOfOneScanUnderTwoNames) {
  EXPECT_EQ(run({"participant"}).status, 0);
  for (const char* visit : {"sub-01", "sub-02_ses-a"}) {
    const fs::path measured = out() / "emmetrope" / "cases" / visit;
    fs::remove_all(measured);
    test::make_fixture_case(measured);
  }
  EXPECT_THAT(warnings({"group"}),
              HasSubstr("OD (right) of sub-01 and of sub-02_ses-a have the same numbers"));
}

TEST_F(BidsApp, AgeOfTheSessionAndSexOfTheTableAreInTheRows) {
  write_file(dataset() / "participants.tsv", "participant_id\tage\tsex\nsub-01\t30\tM\nsub-02\t40\tfemale\n");
  write_file(dataset() / "sub-02" / "sub-02_sessions.tsv", "session_id\tage\nses-a\t40\nses-b\t42\n");
  EXPECT_EQ(run({"participant"}).status, 0);
  EXPECT_EQ(run({"group"}).status, 0);
  const Table table = read_table(out() / "cohort.tsv", {"participant_id", "age", "sex"});
  std::vector<std::string> said;
  for (std::size_t row = 0; row < table.rows.size(); row += 2)
    said.push_back(table.cell(row, "participant_id") + " " + table.cell(row, "age") + " " +
                   table.cell(row, "sex"));
  EXPECT_THAT(said, testing::ElementsAre("sub-01 30 M", "sub-02_ses-a 40 F", "sub-02_ses-b 42 F"));
}

TEST_F(BidsApp, OneRunAtATimeMeasuresAParticipant) {
  const CaseLock other(out() / "emmetrope" / "cases" / "sub-01", true);
  ::unsetenv("EMMETROPE_CASE_LOCK");
  EXPECT_EQ(run({"participant", "--participant-label", "01"}).status, 5);
  EXPECT_EQ(run({"participant", "--participant-label", "02"}).status, 0);
}

TEST_F(BidsApp, AFaultOfTheMachineIsOneOfTheJob) {
  stages_.tell("sub-01", "trace", "7");
  const ProcessResult ended = run({"participant", "--participant-label", "01"});
  EXPECT_EQ(ended.status, 1);
  EXPECT_THAT(ended.output, HasSubstr("sub-01"));
  stages_.forget("sub-01", "trace");
  EXPECT_EQ(run({"participant", "--participant-label", "01"}).status, 0);
  stages_.tell("sub-01", "segment", "5");
  EXPECT_EQ(run({"participant", "--participant-label", "01"}).status, 1);
  EXPECT_TRUE(fs::exists(out() / "emmetrope" / "cases" / "sub-01" / "raytrace"));  // what was there stays
  EXPECT_TRUE(fs::exists(out() / "sub-01" / "anat" / "sub-01_eyes.tsv"));
}

TEST_F(BidsApp, SaysWhatIsWrongWithWhatItWasGiven) {
  EXPECT_EQ(run({"everybody"}).status, 2);
  const ProcessResult nobody = run({"participant", "--participant-label", "07"});
  EXPECT_EQ(nobody.status, 3);
  EXPECT_THAT(nobody.output, HasSubstr("sub-07"));
  EXPECT_EQ(run({"participant", "--participant-label", "../x"}).status, 2);
  const ProcessResult no_session = run({"participant", "--session-label", "a", "z"});
  EXPECT_EQ(no_session.status, 3);
  EXPECT_THAT(no_session.output, HasSubstr("ses-z"));
  EXPECT_EQ(run({"group"}).status, 3);
  EXPECT_FALSE(fs::exists(out() / "cohort.tsv"));
  EXPECT_EQ(stages_.run("bids", {dataset().string(), (dataset() / "sub-01").string(), "participant"}).status,
            2);
  fs::remove(dataset() / "dataset_description.json");
  EXPECT_EQ(run({"participant"}).status, 3);
  EXPECT_TRUE(stages_.runs().empty());
}

}  // namespace
}  // namespace emmetrope::cohort
