#include "pipeline/cohort/subjects/subjects.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/cohort/subjects/readings.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class Subjects : public testing::Test {
 protected:
  void add(const fs::path& image) {
    fs::create_directories((folder() / image).parent_path());
    write_file(folder() / image, "an image");
  }
  std::vector<std::string> ids(const fs::path& studies) const {
    std::vector<std::string> ids;
    for (const Subject& subject : find_subjects(studies)) ids.push_back(subject.id);
    return ids;
  }
  std::string refusal(const fs::path& studies) const {
    try {
      find_subjects(studies);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.what();
    }
    return "";
  }
  const fs::path& folder() const { return temporary_.path(); }
  test::TemporaryFolder temporary_;
};

TEST_F(Subjects, AreTheFoldersOfAFolder) {
  add("studies/b/1.dcm");
  add("studies/a c/deep/1.dcm");
  add("studies/.hidden/1.dcm");
  write_file(folder() / "studies" / "note.txt", "no study");
  const std::vector<Subject> found = find_subjects(folder() / "studies");
  EXPECT_THAT(ids(folder() / "studies"), ElementsAre("a_c", "b"));
  EXPECT_EQ(found[0].study, folder() / "studies" / "a c");
  EXPECT_EQ(found[0].fingerprint.at("files"), 1);
}

TEST_F(Subjects, OfBidsAreItsSessions) {
  for (const char* image :
       {"sub-01/anat/sub-01_T1w.nii.gz", "sub-02/ses-a/anat/x.nii.gz", "sub-02/ses-b/anat/x.nii.gz",
        "sub-03/func/x.nii.gz", "derivatives/sub-01/anat/x.nii.gz"})
    add(fs::path("bids") / image);
  write_file(folder() / "bids" / "dataset_description.json", "{}");
  EXPECT_THAT(ids(folder() / "bids"), ElementsAre("sub-01", "sub-02_ses-a", "sub-02_ses-b"));
}

TEST_F(Subjects, TakeReadingsFromTheTableBesideThem) {
  add("bids/sub-01/anat/x.nii.gz");
  add("bids/sub-02/ses-a/anat/x.nii.gz");
  write_file(folder() / "bids" / "dataset_description.json", "{}");
  write_file(folder() / "bids" / "participants.tsv",
             "participant_id\tage\tkeratometry_od\trefraction_os\n"
             "sub-01\tn/a\t43.25@175/44.75@85+-0.25\t\nsub-02\t31\tn/a\t-2.25/-1.00x180@12\r\n");
  const std::vector<Subject> found = find_subjects(folder() / "bids");
  EXPECT_THAT(found.at(0).options.at("mesh"), ElementsAre("--keratometry", "od:43.25@175/44.75@85+-0.25"));
  EXPECT_EQ(found[0].options.count("correct"), 0U);
  EXPECT_THAT(found.at(1).options.at("segment"), ElementsAre("--age", "31"));
  EXPECT_THAT(found[1].options.at("correct"),
              ElementsAre("--age", "31", "--refraction", "os:-2.25/-1.00x180@12"));
  write_json(folder() / "subject.json", to_json(found[1]));
  const Subject read = read_subject(folder() / "subject.json", "sub-02_ses-a");
  EXPECT_EQ(read.options, found[1].options);
  EXPECT_EQ(read.study, found[1].study);
}

TEST_F(Subjects, OfBidsAreAsOldAsTheirSessionsSay) {
  for (const char* image : {"sub-01/ses-a/anat/x.nii.gz", "sub-01/ses-b/anat/x.nii.gz",
                            "sub-01/ses-c/anat/x.nii.gz", "sub-02/ses-a/anat/x.nii.gz"})
    add(fs::path("bids") / image);
  write_file(folder() / "bids" / "dataset_description.json", "{}");
  const fs::path people = folder() / "bids/participants.tsv",
                 sessions = folder() / "bids/sub-01/sub-01_sessions.tsv";
  write_file(people, "participant_id\tage\tsex\nsub-01\t8\tFemale\nsub-02\t31\tunknown\n");
  write_file(sessions, "session_id\tage\nses-a\t8.2\nses-b\t10.4\nses-c\tn/a\n");
  const std::vector<Subject> found = find_subjects(folder() / "bids");
  const std::vector<std::string> ages{"8.2", "10.4", "8", "31"}, sexes{"F", "F", "F", ""};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(found.at(i).age, ages[i]);
    EXPECT_EQ(found[i].sex, sexes[i]);
    for (const char* command : {"segment", "trace", "correct"})
      EXPECT_THAT(found[i].options.at(command), ElementsAre("--age", ages[i]));
  }
  write_json(folder() / "subject.json", to_json(found[1]));
  EXPECT_EQ(read_subject(folder() / "subject.json", "sub-01_ses-b").sex, "F");

  // As it was measured, until a table says otherwise.
  const auto said = [&] { return contradictions(found, read_table(people, {id_column})); };
  EXPECT_THAT(said(), testing::IsEmpty());
  write_file(sessions, "session_id\tage\nses-a\t8.2\nses-b\t10.5\n");
  EXPECT_THAT(said(),
              ElementsAre(HasSubstr("sub-01_sessions.tsv: line 3, column age: \"10.5\"; sub-01_ses-b was")));
  fs::remove_all(folder() / "bids" / "sub-01");  // the group needs no images
  EXPECT_THAT(said(), testing::IsEmpty());
  write_file(people, "participant_id\tage\tsex\nsub-01\t8\tf\nsub-02\t31\tM\n");
  EXPECT_THAT(said(), ElementsAre(HasSubstr("column sex: \"M\"; sub-02_ses-a was")));

  add("bids/sub-01/ses-b/anat/x.nii.gz");
  write_file(sessions, "session_id\tage\nses-b\t9\nses-b\t10\n");
  EXPECT_THAT(refusal(folder() / "bids"),
              HasSubstr("line 3, column session_id: the session has a row already"));
  write_file(sessions, "session_id\tage\nses-b\tten\n");
  EXPECT_THAT(refusal(folder() / "bids"), HasSubstr("\"ten\" is no age"));
}

TEST_F(Subjects, ThatLookAlikeKeepTheirOwnReadings) {
  for (const char* study : {"P1", "P1_ses-2", "7", "sub-7"}) add(fs::path("scans") / study / "1.dcm");
  write_file(folder() / "scans" / "participants.tsv", "participant_id\tage\nP1\t30\nP1_ses-2\t32\n7\t50\n");
  std::map<std::string, std::vector<std::string>> ages;
  for (const Subject& subject : find_subjects(folder() / "scans"))
    if (const auto found = subject.options.find("segment"); found != subject.options.end())
      ages[subject.id] = found->second;
  EXPECT_THAT(ages.at("P1"), ElementsAre("--age", "30"));
  EXPECT_THAT(ages.at("P1_ses-2"), ElementsAre("--age", "32"));
  EXPECT_EQ(ages.count("sub-7"), 0U);
}

TEST_F(Subjects, OddFoldersDoNotStopTheOthers) {
  add("scans/loop/1.dcm");
  fs::create_directory_symlink(".", folder() / "scans" / "loop" / "round");
  EXPECT_THAT(ids(folder() / "scans"), ElementsAre("loop"));
  add("scans/M\xfcller/1.dcm");
  EXPECT_THAT(refusal(folder() / "scans"), HasSubstr("is not UTF-8"));
  add("lines/one\ntwo/1.dcm");
  EXPECT_THAT(refusal(folder() / "lines"),
              HasSubstr("one two holds a line break or another control character"));
}

/// A spreadsheet would take it for one.
TEST_F(Subjects, NoNameIsAFormula) {
  for (const char* name : {"+2+5+cmd", "-2", "=1", "@x"}) add(fs::path("scans") / name / "1.dcm");
  EXPECT_THAT(ids(folder() / "scans"), testing::UnorderedElementsAre("_+2+5+cmd", "_-2", "_1", "_x"));
}

TEST_F(Subjects, AreNamedByATable) {
  add("scans/x/1.dcm");
  write_file(folder() / "people.tsv", "participant_id\tstudy\nfirst\tscans/x\n");
  EXPECT_THAT(ids(folder() / "people.tsv"), ElementsAre("first"));
}

/// BIDS tells a column's unit in the table's sidecar.
TEST_F(Subjects, AgesAreOfTheUnitThatTheSidecarNames) {
  add("bids/sub-01/anat/x.nii.gz");
  write_file(folder() / "bids" / "dataset_description.json", "{}");
  write_file(folder() / "bids" / "participants.tsv", "participant_id\tage\nsub-01\t18\n");
  const auto age_in = [&](const std::string& units) {
    write_file(folder() / "bids" / "participants.json", "{\"age\": {\"Units\": " + units + "}}");
    return find_subjects(folder() / "bids").at(0).age;
  };
  EXPECT_EQ(age_in("\"years\""), "18");
  for (const char* unsaid :
       {"null", "\"\"", "\"n/a\"", "\"Year(s)\"", "\" years old\"", "[\"years\"]", "\"yo\"", "\"a\""})
    EXPECT_EQ(age_in(unsaid), "18") << unsaid;
  EXPECT_EQ(age_in("\"decimal years\""), "18");
  EXPECT_EQ(age_in("\"Month\""), "1.5");
  EXPECT_EQ(age_in("\"decimal months\""), "1.5");
  EXPECT_NEAR(std::stod(age_in("\"weeks\"")), 18 * 7 / 365.25, 1e-5);
  EXPECT_NEAR(std::stod(age_in("\"days\"")), 18 / 365.25, 1e-6);
  write_file(folder() / "bids" / "participants.json", "{\"age\": {\"Units\": \"month\"},}");
  EXPECT_EQ(find_subjects(folder() / "bids").at(0).age, "18") << "a file that is no JSON is warned of";
  write_file(folder() / "bids" / "participants.json", "{\"age\": {\"Units\": \"decades\"}}");
  EXPECT_THAT(refusal(folder() / "bids"), AllOf(HasSubstr("participants.json"), HasSubstr("decades")));
  write_file(folder() / "bids" / "participants.json", "{\"age\": {\"Units\": \"years and months\"}}");
  EXPECT_THAT(refusal(folder() / "bids"), HasSubstr("years and months"));
  for (const char* odd :
       {"[1]", "{\"age\": [\"years\"]}", "{\"age\": \"years\"}", "{\"age\": {\"Units\": []}}"}) {
    write_file(folder() / "bids" / "participants.json", odd);
    EXPECT_NO_THROW(find_subjects(folder() / "bids")) << odd;
  }
}

TEST_F(Subjects, OfBidsHaveImagesOfTheirOwn) {
  add("bids/sub-10/ses-1/anat/sub-10_ses-1_T1w.nii.gz");
  write_file(folder() / "bids" / "dataset_description.json", "{}");
  add("bids/sub-11/anat/sub-11_T2w.nii.gz");
  EXPECT_EQ(find_subjects(folder() / "bids").size(), 2U);
  add("bids/sub-10/ses-1/anat/sub-10_ses-9_T2w.nii.gz");
  EXPECT_THAT(refusal(folder() / "bids"), HasSubstr("is not that of sub-10_ses-1"));
  fs::remove(folder() / "bids/sub-10/ses-1/anat/sub-10_ses-9_T2w.nii.gz");
  add("bids/sub-11/anat/sub-1_T2w.nii.gz");
  EXPECT_THAT(refusal(folder() / "bids"), HasSubstr("is not that of sub-11"));
}

TEST_F(Subjects, OfBidsMayHaveColumnsOfTheirOwners) {
  add("bids/sub-01/anat/x.nii.gz");
  write_file(folder() / "bids" / "dataset_description.json", "{}");
  write_file(folder() / "bids" / "participants.tsv",
             "participant_id\tACD\trefraction\nsub-01\t3.1 mm\tn/a\n");
  EXPECT_EQ(find_subjects(folder() / "bids").at(0).options.size(), 0U);
}

TEST_F(Subjects, ThatAreNoneAreRefusedByNameAndLine) {
  EXPECT_THAT(refusal(folder() / "nothing"), HasSubstr("neither a folder nor a .tsv table"));
  fs::create_directory(folder() / "empty");
  EXPECT_THAT(refusal(folder() / "empty"), HasSubstr("no study in"));
  add("two/a b/1.dcm");
  add("two/a_b/1.dcm");
  EXPECT_THAT(refusal(folder() / "two"), HasSubstr("two studies have the name \"a_b\""));
  write_file(folder() / "people.tsv", "participant_id\tstudy\nx\tgone\n");
  EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr("line 2, column study: \"gone\""));
  write_file(folder() / "people.tsv", "participant_id\tstudy\n\nx\tn/a\n");
  EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr("line 3, column study: \"\" is no folder"));
  write_file(folder() / "people.tsv", "participant_id\tstudy\nn/a\ttwo\n");
  EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr("names nobody"));
  write_file(folder() / "people.tsv", "participant_id\tstudy\nx\ttwo\nx\ttwo\n");
  EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr("\"x\" has a row already"));
  for (const char* column : {"axial_length_OD", "axial_length_right", "keratometry", "Refraction.L",
                             "axiallength_od", "Axial length OD (mm)", "od_acd", "lens_thickness_od ", "Age",
                             "SEX", "Age (years)", "Study", "Participant_ID"}) {
    write_file(folder() / "people.tsv", fmt::format("participant_id\tstudy\t{}\nx\ttwo\tn/a\n", column));
    EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr(column)) << column;
  }
  for (const char* reading : {"keratometry_od\t7.70@180/7.5@90", "axial_length_os\t0.0235", "acd_od\t3,1",
                              "refraction_od\t+225/-100x10"}) {
    const std::string text = reading;
    const std::size_t tab = text.find('\t');
    write_file(folder() / "people.tsv", fmt::format("participant_id\tstudy\t{}\nx\ttwo\t{}\n",
                                                    text.substr(0, tab), text.substr(tab + 1)));
    EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr("line 2, column " + text.substr(0, tab))) << text;
  }
  write_file(folder() / "people.tsv", "participant_id\tage\nx\t3\n");
  EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr("the column \"study\" is missing"));
  write_file(folder() / "people.tsv", "participant_id\tstudy\nx\n");
  EXPECT_THAT(refusal(folder() / "people.tsv"), HasSubstr("line 2 has 1 cells, the header 2"));
}

/// Of a table that names the disk's top folder that subject alone fails, and soon (found by fuzzing).
TEST_F(Subjects, OfADisksFilesNoMoreIsLookedAtThanAStudyHas) {
  fs::create_directories(folder() / "disk");
  for (int i = 0; i < 100'010; ++i) std::ofstream(folder() / "disk" / std::to_string(i));
  write_file(folder() / "table.tsv", "participant_id\tstudy\nsub-1\tdisk\n");
  EXPECT_EQ(find_subjects(folder() / "table.tsv")[0].fingerprint.at("files"), 100'000);
}

TEST_F(Subjects, OfBidsMayHavePlusInTheirNamesAndAges) {
  add("bids/sub-a+b/anat/x.nii.gz");
  write_file(folder() / "bids" / "dataset_description.json", "{}");
  write_file(folder() / "bids" / "participants.tsv", "participant_id\tage\nsub-a+b\t89+\n");
  const std::vector<Subject> found = find_subjects(folder() / "bids");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].id, "sub-a+b");
  EXPECT_THAT(found[0].options.at("segment"), ElementsAre("--age", "89"));
  write_file(folder() / "bids" / "participants.tsv", "participant_id\tage\nsub-a+b\told\n");
  EXPECT_THAT(refusal(folder() / "bids"), HasSubstr("line 2, column age: \"old\" is no age"));
  write_file(folder() / "bids" / "participants.tsv", "participant_id\tage\nsub-a+b\t8\na+b\t9\n");
  EXPECT_THAT(refusal(folder() / "bids"), HasSubstr("has a row already"));
}

TEST_F(Subjects, OfATableHaveEachAStudyOfTheirOwn) {
  add("scans/x/1.dcm");
  write_file(folder() / "people.tsv", "participant_id\tstudy\nfirst\tscans/x\nsecond\tscans/../scans/x\n");
  EXPECT_THAT(refusal(folder() / "people.tsv"),
              HasSubstr("line 3, column study: \"scans/../scans/x\" is the study of \"first\""));
}

TEST_F(Subjects, OfAFolderHaveEachAStudyOfTheirOwn) {
  add("scans/a/1.dcm");
  fs::create_directory_symlink("a", folder() / "scans" / "l");
  EXPECT_THAT(refusal(folder() / "scans"), HasSubstr("scans/l is the study of \"a\" already"));
}

TEST_F(Subjects, StudiesThatChangeNamesAreOtherStudies) {
  const auto a = folder() / "studies/a", b = folder() / "studies/b";
  for (const auto& [study, who] : {std::pair{a, 'A'}, {b, 'B'}}) {
    fs::create_directories(study);
    write_file(study / "1.nii", std::string(20000, '\0') + std::string(1, who) + std::string(20000, '\0'));
  }
  fs::last_write_time(a / "1.nii", fs::last_write_time(b / "1.nii"));
  const Json before = find_subjects(folder() / "studies")[0].fingerprint;
  fs::rename(a, folder() / "c");
  fs::rename(b, a);
  fs::rename(folder() / "c", b);
  EXPECT_NE(find_subjects(folder() / "studies")[0].fingerprint, before);
}

TEST_F(Subjects, AnImageThatIsReplacedIsAnotherStudy) {
  add("studies/a/1.dcm");
  add("studies/a/2.dcm");
  const Json before = find_subjects(folder() / "studies")[0].fingerprint;
  fs::last_write_time(folder() / "studies/a/1.dcm",
                      fs::last_write_time(folder() / "studies/a/1.dcm") - std::chrono::hours(1));
  EXPECT_NE(find_subjects(folder() / "studies")[0].fingerprint, before);
}

}  // namespace
}  // namespace emmetrope::cohort
