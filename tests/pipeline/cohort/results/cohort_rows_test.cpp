#include "pipeline/cohort/results/cohort_rows.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

#include "pipeline/base/files.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/cohort/results/cohort_page.hpp"
#include "pipeline/cohort/results/quantities.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/table.hpp"
#include "tests/support/fixture_case.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class CohortRows : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(cohort_.root() / "cases");
    test::make_fixture_case(cohort_.case_folder("whole"));
    test::FixtureOptions right;
    right.only_right = true;
    test::make_fixture_case(cohort_.case_folder("right"), right);
    fs::create_directories(cohort_.case_folder("broken"));
    end("whole", {});
    end("right", {{"segment", {8, "OD (right): a; b\nOS (left): no such eye in the images"}}});
    end("broken", {{"segment", {3, "slice 3 is\tmissing"}},
                   {"mesh", {}},
                   {"trace", {}},
                   {"correct", {}},
                   {"report", {}}});
    write_file(cohort_.root() / "subjects.txt", "broken\nright\nwhole\n");
  }
  void end(const std::string& subject, const std::map<std::string, StageEnd>& ends) {
    fs::create_directories(cohort_.root() / "ends" / subject);
    for (const PipelineStage& stage : pipeline_stages) {
      const auto told = ends.find(stage.command);
      write_json(cohort_.end_file(subject, stage.command),
                 to_json(told == ends.end() ? StageEnd{0, ""} : told->second));
    }
  }
  test::TemporaryFolder temporary_;
  CohortFolder cohort_{temporary_.path() / "cohort"};
};

TEST_F(CohortRows, TellWhatCameOfEachEye) {
  const std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  ASSERT_EQ(rows.size(), 6U);
  EXPECT_EQ(rows[0].outcome, Outcome::failed);
  EXPECT_EQ(rows[0].stage, "segment");
  EXPECT_EQ(rows[0].reason, "slice 3 is missing");
  EXPECT_EQ(rows[2].outcome, Outcome::measured);  // the right eye of "right"
  EXPECT_EQ(rows[2].reason, "");
  EXPECT_EQ(rows[3].outcome, Outcome::no_result);
  EXPECT_EQ(rows[3].reason, "no such eye in the images");
  EXPECT_EQ(rows[4].outcome, Outcome::measured);
  const Outcomes outcomes = count_outcomes(rows);
  EXPECT_EQ(outcomes.measured, 3U);
  EXPECT_EQ(outcomes.failed, 2U);
}

TEST_F(CohortRows, SayWhereARefractionIsNoPrescription) {
  const fs::path file = cohort_.case_folder("right") / "correction/od/prescription.json";
  Json prescription = read_json(file);
  prescription["withheld"] = "the interval is too wide";
  write_json(file, prescription);
  const std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  EXPECT_EQ(rows[2].outcome, Outcome::measured);
  EXPECT_EQ(rows[2].stage, "correct");
  EXPECT_EQ(rows[2].reason, "no prescription: the interval is too wide");
  EXPECT_EQ(rows[4].reason, "");
  prescription["withheld"] = nullptr;
  prescription["estimate"] = "an estimate, do not dispense";
  write_json(file, prescription);
  const std::vector<EyeRow> estimated = read_rows(cohort_, listed_subjects(cohort_));
  EXPECT_EQ(estimated[2].reason, "an estimate, do not dispense");
  EXPECT_EQ(estimated[2].stage, "");
}

/// Most refractions are estimates: among as many the eyes that failed would not be seen.
TEST_F(CohortRows, OfEstimatesAreNotAmongTheEyesThatGaveLess) {
  const fs::path file = cohort_.case_folder("right") / "correction/od/prescription.json";
  Json prescription = read_json(file);
  prescription["estimate"] = "an estimate, do not dispense";
  write_json(file, prescription);
  const std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  EXPECT_THAT(table_text(rows), HasSubstr("measured\tn/a\tan estimate, do not dispense"));
  const std::string page = cohort_page(cohort_, rows, cohort_.root());
  EXPECT_THAT(page, HasSubstr("slice 3 is missing"));
  EXPECT_THAT(page, testing::Not(HasSubstr("an estimate, do not dispense")));
}

TEST_F(CohortRows, OfACorneaThatMayBeASphereHaveNoAxis) {
  const fs::path file = cohort_.case_folder("right") / "meshing/od/biometry.json";
  Json biometry = read_json(file);
  biometry["keratometry"]["cylinder_D"]["ci95"] = {0, 1.5};
  write_json(file, biometry);
  const std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  EXPECT_EQ(rows[2].numbers.count("flat_axis"), 0U);
  EXPECT_EQ(rows[2].numbers.count("flat_power"), 1U);
  EXPECT_EQ(rows[4].numbers.count("flat_axis"), 1U);
}

TEST_F(CohortRows, SexIsThatOfTheImagesBeforeThatOfTheTable) {
  fs::create_directories(cohort_.root() / "subjects");
  for (const char* subject :
       {"broken", "right", "whole"})  // the images of the fixture are a woman's; "broken" has none
    write_json(cohort_.subject_file(subject), {{"sex", subject == std::string("whole") ? "F" : "M"}});
  const std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  EXPECT_EQ(rows[0].sex, "M");
  EXPECT_EQ(rows[2].sex, "F");
  const std::string said = "right: the images are of sex F, by the table of participants it is M";
  EXPECT_THAT(sexes_that_differ(rows), testing::ElementsAre(HasSubstr(said)));
  EXPECT_THAT(cohort_page(cohort_, rows, cohort_.root()), HasSubstr(said));
}

TEST_F(CohortRows, OfOneScanUnderTwoNamesAreTold) {
  std::vector<EyeRow> rows =
      read_rows(cohort_, listed_subjects(cohort_));  // "right" and "whole" are one fixture
  EXPECT_THAT(doubts_about(rows),
              testing::ElementsAre(HasSubstr("OD (right) of right and of whole have the same numbers"),
                                   HasSubstr("right and whole are images of one study")));
  rows[4].numbers.begin()->second.value += 1e-9;
  EXPECT_THAT(scans_named_twice(rows), testing::IsEmpty());
  // Another age makes other numbers of the same images.
  rows[2].scans = {"a", "b"};
  rows[4].scans = {"b"};
  EXPECT_THAT(
      scans_named_twice(rows),
      testing::ElementsAre(HasSubstr("OD (right) of right and of whole have images with the same voxels")));
  rows[4].scans = {"c"};
  EXPECT_THAT(scans_named_twice(rows), testing::IsEmpty());
}

TEST_F(CohortRows, OfOneStudyTakenForSeveralAreTold) {
  std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  EXPECT_THAT(studies_named_twice(rows),
              testing::ElementsAre(HasSubstr("right and whole are images of one study")));
  for (EyeRow& row : rows)
    if (row.subject == "whole") row.study = "another";
  EXPECT_THAT(studies_named_twice(rows), testing::IsEmpty());
}

TEST_F(CohortRows, AgesThatDifferAndSexesThatAnonymisersWrite) {
  fs::create_directories(cohort_.root() / "subjects");
  const fs::path file = cohort_.case_folder("right") / "case.json";
  Json case_json = read_json(file);
  case_json["subject"]["age_years"] = 38;
  case_json["subject"]["sex"] = "O";
  write_json(file, case_json);
  write_json(cohort_.subject_file("right"), {{"sex", "F"}, {"age", "60"}});
  std::vector<EyeRow> rows = read_rows(cohort_, {"right"});
  EXPECT_EQ(rows[0].sex, "F");
  EXPECT_THAT(sexes_that_differ(rows), testing::IsEmpty());
  EXPECT_EQ(rows[0].age_years, 38);
  EXPECT_THAT(
      doubts_about(rows),
      testing::ElementsAre(HasSubstr("right: the images tell an age of 38, the table of participants 60")));
  write_json(cohort_.subject_file("right"), {{"age", "38.6"}});  // rounded otherwise
  EXPECT_THAT(doubts_about(read_rows(cohort_, {"right"})), testing::IsEmpty());
}

/// Numbers of a stage that was made from another than lies beside it are none.
TEST_F(CohortRows, AreOfCasesAsTheStagesLeftThem) {
  const fs::path case_folder = cohort_.case_folder("right"),
                 biometry = case_folder / "meshing/od/biometry.json";
  const auto note = [&](const char* stage, const char* what, const std::string& name) {
    const fs::path file = case_folder / stage / "stage.json";
    Json json = read_json(file);
    json[what] = {{name, sha256_of_file(case_folder / name)}};
    write_json(file, json);
  };
  for (const char* stage : {"raytrace", "correction"}) note(stage, "inputs", "meshing/od/biometry.json");
  EXPECT_EQ(read_rows(cohort_, {"right"})[0].outcome, Outcome::measured);
  Json json = read_json(biometry);
  json["axial_length_mm"]["value"] = 30;
  write_json(biometry, json);
  const EyeRow mixed = read_rows(cohort_, {"right"})[0];
  EXPECT_NE(mixed.outcome, Outcome::measured);
  EXPECT_EQ(mixed.stage, "trace");
  EXPECT_THAT(mixed.reason, HasSubstr("raytrace was made from another meshing"));
  EXPECT_THAT(mixed.reason, HasSubstr("remove the case"));
  EXPECT_THAT(mixed.reason, testing::Not(HasSubstr(case_folder.parent_path().string())));
  EXPECT_EQ(mixed.numbers.at("axial_length").value, 30);  // which meshing may have made, as far as is known
  EXPECT_EQ(mixed.numbers.count("refraction_m"), 0U);
}

TEST_F(CohortRows, HaveNoNumbersThatSomebodyEdited) {
  const fs::path case_folder = cohort_.case_folder("whole"),
                 biometry = case_folder / "meshing/od/biometry.json",
                 file = case_folder / "meshing/stage.json";
  Json stage = read_json(file);
  stage["outputs"] = Json::object();
  for (const auto& entry : fs::recursive_directory_iterator(case_folder / "meshing"))
    if (entry.is_regular_file() && entry.path() != file)
      stage["outputs"][fs::relative(entry.path(), case_folder).string()] = sha256_of_file(entry.path());
  write_json(file, stage);
  EXPECT_EQ(read_rows(cohort_, {"whole"})[0].numbers.count("axial_length"), 1U);
  Json json = read_json(biometry);
  json["axial_length_mm"]["value"] = 30;
  write_json(biometry, json);
  const EyeRow edited = read_rows(cohort_, {"whole"})[0];
  EXPECT_EQ(edited.numbers.count("axial_length"), 0U);
  EXPECT_EQ(edited.stage, "mesh");
  EXPECT_THAT(edited.reason,
              HasSubstr("the case/meshing/od/biometry.json has been changed since meshing wrote it"));
}

TEST_F(CohortRows, KnowTheImagesThatWereUsed) {
  const fs::path file = cohort_.case_folder("right") / "case.json";
  Json case_json = read_json(file);
  case_json["series"][0].update({{"columns", 24}, {"rows", 20}, {"min", 0}, {"max", 900}, {"mean", 123.456}});
  write_json(file, case_json);
  const std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  EXPECT_EQ(rows[2].scans.size(), 1U);
  EXPECT_TRUE(rows[4].scans.empty());
}

TEST(FellowEyes, AreOfOneSubject) {
  std::vector<EyeRow> rows;
  const auto add = [&](const char* subject, Laterality eye) {
    EyeRow& row = rows.emplace_back();
    row.subject = subject;
    row.eye = eye;
  };
  add("a", Laterality::od);
  add("b", Laterality::os);
  add("c", Laterality::od);
  add("c", Laterality::os);
  add("d", Laterality::os);
  add("e", Laterality::os);
  EXPECT_THAT(fellow_eyes(rows), testing::ElementsAre(testing::Pair(&rows[2], &rows[3])));
}

TEST_F(CohortRows, OfOneEyeAreASubjectToo) {
  fs::create_directories(cohort_.root() / "subjects");
  for (const char* subject : {"broken", "right"}) write_json(cohort_.subject_file(subject), {{"eyes", "od"}});
  const std::vector<EyeRow> rows = read_rows(cohort_, listed_subjects(cohort_));
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_THAT(cohort_page(cohort_, rows, cohort_.root()), HasSubstr("<dt>Subjects</dt><dd>3</dd>"));
}

TEST_F(CohortRows, OfTheTableAreTheNumbersOfTheCases) {
  const fs::path file = temporary_.path() / "cohort.tsv";
  write_file(file, table_text(read_rows(cohort_, listed_subjects(cohort_))));
  const Table table = read_table(file, {"participant_id", "eye", "outcome"});
  const Json biometry = read_json(cohort_.case_folder("whole") / "meshing" / "os" / "biometry.json");
  const Json dictionary = table_dictionary();
  for (const auto& column : table.columns) EXPECT_TRUE(dictionary.contains(column.first)) << column.first;
  EXPECT_EQ(table.columns.size(), dictionary.size());
  int numbers = 0;
  for (const Quantity& quantity : quantities()) {
    if (quantity.stage != "meshing" || !biometry.contains(Json::json_pointer(quantity.key))) continue;
    if (quantity.column == "flat_axis") {  // the fixture's left cornea may be a sphere
      EXPECT_EQ(table.cell(5, quantity.column), "");
      continue;
    }
    const auto measured = biometry.at(Json::json_pointer(quantity.key)).get<Measured>();
    EXPECT_NEAR(std::stod(table.cell(5, quantity.column)), measured.value, 1e-5 * std::abs(measured.value));
    EXPECT_NEAR(std::stod(table.cell(5, quantity.column + "_low")), measured.ci95[0],
                1e-5 * std::abs(measured.value));
    EXPECT_EQ(table.cell(5, quantity.column + "_source"), measured.source);
    EXPECT_EQ(table.cell(0, quantity.column), "");
    ++numbers;
  }
  EXPECT_GT(numbers, 20);
}

TEST_F(CohortRows, MakeAPageThatTellsThemWithoutANetwork) {
  const std::string page = cohort_page(cohort_, read_rows(cohort_, listed_subjects(cohort_)), cohort_.root());
  for (const char* text : {"slice 3 is missing", "no such eye in the images", "Axial length, optical, mm"})
    EXPECT_THAT(page, HasSubstr(text));
  EXPECT_FALSE(std::regex_search(page, std::regex("(src|href)=\"https?:")));
}

}  // namespace
}  // namespace emmetrope::cohort
