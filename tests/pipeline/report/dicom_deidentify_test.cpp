#include <cstdlib>

#include "tests/pipeline/report/report_fixture.hpp"

// What `emmetrope deidentify` leaves, read by other programs: dcmdump, dciodvfy, pdftotext.

namespace emmetrope::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Deidentify : public ReportTest {
 protected:
  void SetUp() override {
    ReportTest::SetUp();
    test::FixtureOptions options;
    options.stage_warning = "a series of study 1.2.826.0.1.3680043.10.1.9 of HOUSE is left out";
    test::make_fixture_case(folder_, options);
    study_ = folder_.string() + "-study";
    fs::remove_all(study_);
    test::make_fixture_study(study_);
    test::note_study(folder_, study_);
    Json json = read_json(folder_ / "case.json");
    json["series"][0]["description"] = "T2 FOR DR HOUSE";
    json["stacks"][0]["used"] = false;
    json["stacks"][0]["reason"] = "less of the eyes than in the STUDY OF HOUSE";
    json["subject"]["age_years"] = 43;
    json["subject"]["sex"] = "F";
    write_json(folder_ / "case.json", json);
    report(study_);
  }
  void TearDown() override {
    ReportTest::TearDown();
    fs::remove_all(study_);
  }

  int deidentify(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{folder_.string(), "-o", output_folder().string(), "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_process(fs::path(std::getenv("EMMETROPE_BIN")) / "emmetrope-deidentify", arguments,
                       ChildOutput::capture)
        .status;
  }
  fs::path output_folder() const { return folder_ / "without"; }
  std::vector<fs::path> objects() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(output_folder()))
      if (entry.path().extension() == ".dcm") files.push_back(entry.path());
    return files;
  }
  std::string dumped(const fs::path& file) const {
    return output_of("/usr/bin/dcmdump", {"+L", file.string()});
  }

  std::string pdf_words() const {
    const std::string object = read_file(output_folder() / "report.dcm");
    const fs::path pdf = folder_ / "alone.pdf";
    write_file(pdf, object.substr(object.find("%PDF")));
    return output_of("/usr/bin/pdftotext", {"-layout", pdf.string(), "-"});
  }

  fs::path study_;
};

TEST_F(Deidentify, NothingOfTheStudyIsLeft) {
  ASSERT_EQ(deidentify(), 0);
  ASSERT_EQ(objects().size(), 18U);
  write_file(folder_ / "pdf.txt", pdf_words());
  std::vector<fs::path> files{folder_ / "pdf.txt"};
  for (const auto& entry : fs::recursive_directory_iterator(output_folder()))
    if (entry.is_regular_file()) files.push_back(entry.path());
  for (const fs::path& file : files) {
    const std::string bytes = read_file(file);
    for (const char* telling :
         {"DOE^JANE", "JANE DOE", "Jane Doe", "19610203", "1961-02-03", "1.2.826.0.1.3680043.10.1", "HOUSE"})
      EXPECT_EQ(bytes.find(telling), std::string::npos) << file << ": " << telling;
  }
  for (const fs::path& file : objects()) {
    const std::string dump = dumped(file);
    EXPECT_THAT(dump, HasSubstr("(0012,0062) CS [YES]")) << file;
    EXPECT_THAT(dump, HasSubstr("[113100]")) << file;
    EXPECT_THAT(dump, HasSubstr("(0028,0303) CS [REMOVED]")) << file;
    EXPECT_THAT(dump, HasSubstr("(0010,0020) LO [s-0a1b2c3d]")) << file;
    EXPECT_THAT(dump, HasSubstr("(0010,0030) DA (no value available)")) << file;
    EXPECT_THAT(dump, HasSubstr("(0008,0020) DA (no value available)")) << file;
    EXPECT_THAT(dump, Not(HasSubstr("(0010,1010)"))) << file;  // age
  }
}

TEST_F(Deidentify, ObjectsConform) {
  ASSERT_EQ(deidentify({"--keep-age"}), 0);
  for (const fs::path& file : objects()) {
    const std::string found =
        run_process("/bin/sh",
                    {"-c", "dciodvfy \"$1\" 2>&1 | grep ^Error | grep -v ClinicalTrial", "sh", file.string()},
                    ChildOutput::capture)
            .output;
    EXPECT_EQ(found, "") << file;
    EXPECT_THAT(dumped(file), HasSubstr("(0010,1010) AS [043Y]"));
    EXPECT_THAT(dumped(file), HasSubstr("[113108]"));
  }
}

TEST_F(Deidentify, ThePdfHasNeitherDateNorAge) {
  // An age that a study does not tell may have been given to a stage.
  Json stage = read_json(folder_ / "raytrace" / "stage.json");
  stage["parameters"]["age_years"] = 43;
  write_json(folder_ / "raytrace" / "stage.json", stage);
  ASSERT_EQ(deidentify({"--subject", "S 7"}), 0);
  const std::string text = pdf_words();
  EXPECT_THAT(text, HasSubstr("Subject: S 7"));
  EXPECT_THAT(text, Not(HasSubstr("Study date")));
  EXPECT_THAT(text, Not(HasSubstr("Age:")));
  EXPECT_THAT(text, Not(HasSubstr("lens index 1.")));
  EXPECT_THAT(text, Not(HasSubstr("s-0a1b2c3d")));
  EXPECT_THAT(text, Not(HasSubstr("Normal adult")));  // nor whether it is a child's
}

/// A refraction that was given makes of the index that an age has another, which follows from the age as well.
TEST_F(Deidentify, TheIndexByAGivenRefractionIsLeftOut) {
  const fs::path file = folder_ / "correction" / "od" / "prescription.json";
  Json prescription = read_json(file);
  prescription["calibration"] = {{"given", prescription.at("rounded")},
                                 {"without_it", prescription.at("rounded")},
                                 {"sigma_D", 0.25},
                                 {"surprise_sigma", 1},
                                 {"lens_index_after", Json(Measured{1.4362, {1.428, 1.444}, "prior"})}};
  write_json(file, prescription);
  ASSERT_EQ(deidentify(), 0);
  EXPECT_THAT(pdf_words(), Not(HasSubstr("1.436")));
  fs::remove_all(output_folder());
  ASSERT_EQ(deidentify({"--keep-age"}), 0);
  EXPECT_THAT(pdf_words(), HasSubstr("1.436"));
}

TEST_F(Deidentify, OfOneEyeNothingTellsOfTheOther) {
  ASSERT_EQ(deidentify({"--laterality", "od"}), 0);
  const std::string dump = dumped(output_folder() / "segmentation.dcm");
  EXPECT_THAT(dump, HasSubstr("[right lens]"));
  EXPECT_THAT(dump, Not(HasSubstr("[left ")));
}

/// Without their words, which may quote headers, but not as if there had been none.
TEST_F(Deidentify, ThatAStageHadAWarningIsSaid) {
  Json stage = read_json(folder_ / "correction" / "stage.json");
  stage["warnings"] = {"two optima in THE SERIES OF DOE"};
  stage["verdict"] = {{"status", 8}, {"reasons", {"OD (right): as DOE moved"}}};
  write_json(folder_ / "correction" / "stage.json", stage);
  ASSERT_EQ(deidentify(), 0);
  const std::string text = pdf_words();
  EXPECT_THAT(text, HasSubstr("left out here"));
  EXPECT_THAT(text, Not(HasSubstr("no stage had an error or a warning")));
  EXPECT_THAT(text, Not(HasSubstr("DOE")));
}

TEST_F(Deidentify, ASubjectIsTakenAsItIsOrRefused) {
  for (const std::string& wrong : {std::string(), std::string(65, 'a'), std::string("A\\B"),
                                   std::string(" A"), std::string("A\nB"), std::string("\xff")}) {
    EXPECT_EQ(deidentify({"--subject", wrong}), 2) << wrong;
    EXPECT_FALSE(fs::exists(output_folder()));
  }
  std::string longest(62, 'a');
  longest += "\u00e9\u65e5";  // 64 characters in more bytes
  ASSERT_EQ(deidentify({"--subject", longest}), 0);
  const std::string dump = dumped(output_folder() / "report.dcm");
  EXPECT_THAT(dump, HasSubstr("(0010,0010) PN [" + longest + "]"));
  EXPECT_THAT(dump, HasSubstr("(0010,0020) LO [" + longest + "]"));
}

TEST_F(Deidentify, TwoStudiesOfASubjectStayTwo) {
  const auto study_uid = [&](const char* description) {
    Json json = read_json(folder_ / "case.json");
    json["series"][0]["description"] = description;
    write_json(folder_ / "case.json", json);
    fs::remove_all(output_folder());
    EXPECT_EQ(deidentify({"--subject", "S 7"}), 0);
    const std::string dump = dumped(output_folder() / "report.dcm");
    const std::size_t at = dump.find("(0020,000d)");
    return dump.substr(at, dump.find('\n', at) - at);
  };
  EXPECT_NE(study_uid("first"), study_uid("second"));
}

TEST_F(Deidentify, AFolderThatHoldsSomethingIsLeftAlone) {
  fs::create_directories(output_folder());
  write_file(output_folder() / "mine", "kept");
  EXPECT_EQ(deidentify(), 2);
  EXPECT_EQ(read_file(output_folder() / "mine"), "kept");
}

}  // namespace
}  // namespace emmetrope::report
