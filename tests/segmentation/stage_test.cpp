#include "segmentation/stage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <future>
#include <random>
#include <tuple>

#include "pipeline/base/files.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/parametric/parametric_eye.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/plausible.hpp"
#include "segmentation/intake/study.hpp"
#include "tests/support/generated_series.hpp"
#include "tests/support/phantom_eyes.hpp"

namespace emmetrope::segmentation {
namespace {

namespace fs = std::filesystem;

class SegmentStage : public testing::Test {
 protected:
  void SetUp() override {
    const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = fs::temp_directory_path() / ("emmetrope_segment_" + test + "_" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    common_.verbosity.quiet = true;
  }
  void TearDown() override { fs::remove_all(folder_); }
  Answer run(const fs::path& study, const std::string& name) {
    SegmentOptions options;
    options.study = study;
    options.case_folder = folder_ / name;
    return segment(options, common_);
  }
  ParametricEye eye(const std::string& name, Laterality laterality) const {
    return parametric_eye_from_json(
        read_json(folder_ / name / "segmentation" / to_string(laterality) / "fit.json").at("eye"));
  }
  /// Writes the scan to `study`, zero before a coronal plane (LPS).
  void write_defaced(const fs::path& scan, double plane_y_mm) const {
    const StudyInventory inventory = read_inventory(scan, {});
    Stack stack = read_series(inventory, inventory.series.front().uid, {});
    for (int s = 0; s < stack.slices(); ++s)
      for (int r = 0; r < stack.rows; ++r)
        for (int c = 0; c < stack.columns; ++c)
          if (stack.position(c, r, s).y() < plane_y_mm)
            stack.slice_intensity[s][static_cast<std::size_t>(r) * stack.columns + c] = 0;
    fs::create_directories(folder_ / "study");
    write_nifti(folder_ / "study" / "defaced.nii.gz", stack);
  }
  fs::path folder_;
  CommonOptions common_;
};

double sigma(const ParametricEye& eye, const std::string& name) {
  const auto at =
      std::find(eye.parameter_names.begin(), eye.parameter_names.end(), name) - eye.parameter_names.begin();
  return std::sqrt(eye.covariance(at, at));
}

/// What its fellow tells of an eye does not depend on which is asked for.
TEST_F(SegmentStage, AnEyeThatIsAskedForAloneIsTheSame) {
  write_nifti(folder_ / "small.nii.gz", small_scan(1));
  common_.laterality = LateralityChoice::od;
  EXPECT_EQ(run(folder_ / "small.nii.gz", "one").status, ExitStatus::done);
  EXPECT_TRUE(run(folder_ / "small.nii.gz", "one").json.at("skipped").get<bool>());
  common_.laterality = LateralityChoice::both;
  EXPECT_EQ(run(folder_ / "small.nii.gz", "both").status, ExitStatus::done);
  const fs::path one = folder_ / "one" / "segmentation", both = folder_ / "both" / "segmentation";
  EXPECT_EQ(read_json(one / "od" / "fit.json"), read_json(both / "od" / "fit.json"));
  EXPECT_FALSE(fs::exists(one / "os"));
  for (const char* file : {"labels.json", "od/boundary.ply", "od/overlay_stack1.png",
                           "od/residual_stack1.png", "stack1.nii.gz", "stack1_labels.nii.gz"})
    EXPECT_TRUE(fs::exists(one / file)) << file;
  const Json case_json = read_json(folder_ / "one" / "case.json");
  EXPECT_EQ(case_json.at("eyes").at("od").at("contrast"), "T2");
  EXPECT_FALSE(case_json.at("stacks").at(0).at("reason").get<std::string>().empty());
  EXPECT_TRUE(fs::exists(both / "os" / "fit.json"));
}

/// Every key is on the page, but for the names of parameters that are numbered.
void expect_documented(const Json& json, const std::string& page) {
  if (json.is_array() && !json.empty()) expect_documented(json.front(), page);
  if (!json.is_object()) return;
  for (const auto& [key, value] : json.items()) {
    const bool is_numbered = key.find("_0") != std::string::npos || key.find("_1") != std::string::npos;
    EXPECT_TRUE(is_numbered || page.find('`' + key + '`') != std::string::npos ||
                page.find('"' + key + '"') != std::string::npos)
        << key;
    expect_documented(value, page);
  }
}

/// Both contrasts of a session tell of one eye.
TEST_F(SegmentStage, T1AndT2AreJoined) {
  phantom::HeadGeometry head = phantom::random_head(3), moved = head;
  moved.position_z_mm += 2;  // between the two
  fs::create_directories(folder_ / "study");
  write_nifti(folder_ / "study" / "t2.nii.gz", small_scan(head));
  write_nifti(folder_ / "study" / "t1.nii.gz", small_scan(moved, "t1"));
  ASSERT_EQ(run(folder_ / "study", "both").status, ExitStatus::done);
  const std::string page = read_file(data_folder() / "docs/use/stage-files.md");
  expect_documented(read_json(folder_ / "both" / "case.json"), page);
  for (const Json& stack : read_json(folder_ / "both" / "case.json").at("stacks"))
    EXPECT_TRUE(stack.at("used").get<bool>()) << stack;
  for (const Laterality laterality : both_eyes) {
    const fs::path files = folder_ / "both" / "segmentation" / to_string(laterality);
    const Json fit = read_json(files / "fit.json");
    expect_documented(fit, page);
    const Json& other = fit.at("other_contrast");
    EXPECT_EQ(other.at("contrast"), "T1");
    EXPECT_TRUE(other.at("joined").get<bool>()) << other;
    for (const char* stack : {"stack1", "stack2"})
      for (const char* picture : {"overlay_", "residual_"})
        EXPECT_TRUE(fs::exists(files / (picture + std::string(stack) + ".png"))) << picture << stack;
    const ParametricEye both = eye("both", laterality);
    const phantom::EyeGeometry& truth = head.eye(laterality);
    for (const auto& [name, found_mm, true_mm] :
         {std::tuple{"anterior_chamber_depth_mm", both.anterior_chamber_depth_mm,
                     truth.anterior_chamber_depth_mm},
          {"lens_thickness_mm", both.lens_thickness_mm, truth.lens_thickness_mm},
          {"axial_length_mm", both.axial_length_mm, truth.axial_length_mm}}) {
      EXPECT_NEAR(found_mm, true_mm, 3 * sigma(both, name)) << name;
    }
  }
}

TEST_F(SegmentStage, NothingThatIsKeptNamesThePatient) {
  test::GeneratedSeries series;  // of SECRET^NAME, SECRET-ID-77, born 1986-01-01; it shows no eye
  series.set_all(DCM_SeriesDescription, "Secret T2 1986-01-01 secret-id-77");
  series.remove(5);
  series.write(folder_ / "study" / "SECRET_NAME");
  testing::internal::CaptureStdout();  // where the tests' logger writes
  const Answer answer = run(folder_ / "study", "case");
  const std::string said = testing::internal::GetCapturedStdout() + answer.text + answer.json.dump();
  EXPECT_EQ(answer.status, ExitStatus::no_result);
  const std::string case_json = read_file(folder_ / "case" / "case.json"),
                    stage_json = read_file(folder_ / "case" / "segmentation" / "stage.json");
  for (const std::string& text : {said, case_json, stage_json})
    for (const char* telling : {"SECRET", "Secret", "secret", "1986"})
      EXPECT_EQ(text.find(telling), std::string::npos) << telling << " in " << text;
  for (const std::string& text : {case_json, stage_json})
    EXPECT_NE(text.find("missing between slice 8 and slice 6"), std::string::npos) << text;
}

/// The others measure the eye, and nobody would know that images are missing.
TEST_F(SegmentStage, ASeriesThatIsLeftOutForABrokenFileIsSaid) {
  test::GeneratedSeries whole, broken("1.2.826.0.1.3680043.9.7.2", 2);
  whole.write(folder_ / "study" / "a");
  const fs::path file = broken.write(folder_ / "study" / "b").at(3);
  fs::resize_file(file, fs::file_size(file) - 100);
  EXPECT_EQ(run(folder_ / "study", "case").status, ExitStatus::no_result);
  const std::string warnings =
      read_json(folder_ / "case" / "segmentation" / "stage.json").at("warnings").dump();
  EXPECT_NE(warnings.find("stack2 is not used: "), std::string::npos) << warnings;
  EXPECT_EQ(warnings.find("stack1 is not used"), std::string::npos) << warnings;
}

/// Planes that were computed from an acquired series are that acquisition once more.
TEST_F(SegmentStage, AComputedSeriesIsNotUsedBesideTheAcquiredOne) {
  test::GeneratedSeries acquired, planes("1.2.826.0.1.3680043.9.7.2", 2),
      of_another("1.2.826.0.1.3680043.9.7.3", 3);
  for (test::GeneratedSeries* series : {&planes, &of_another})
    series->set_all(DCM_ImageType, "DERIVED\\SECONDARY\\MPR");
  of_another.set_all(DCM_EchoTime, "12");
  acquired.write(folder_ / "study" / "a");
  planes.write(folder_ / "study" / "b");
  of_another.write(folder_ / "study" / "c");
  EXPECT_EQ(run(folder_ / "study", "case").status, ExitStatus::no_result);
  EXPECT_THAT(
      read_json(folder_ / "case" / "segmentation" / "stage.json").at("warnings").dump(),
      testing::AllOf(testing::HasSubstr("stack2 is not used: (0008,0008) ImageType"),
                     testing::HasSubstr("from stack1"), testing::Not(testing::HasSubstr("stack3 is not"))));
  const Json stacks = read_json(folder_ / "case" / "case.json").at("stacks");
  ASSERT_EQ(stacks.size(), 2U) << stacks;
  EXPECT_EQ(stacks.at(0).at("name"), "stack1");
  EXPECT_EQ(stacks.at(1).at("name"), "stack3");
}

/// What is read is what is hashed: images behind a link too, and nothing of a case among the images.
TEST_F(SegmentStage, InputsAreTheFilesThatAreRead) {
  test::GeneratedSeries series;
  series.write(folder_ / "real");
  fs::create_directories(folder_ / "study");
  fs::create_directory_symlink(folder_ / "real", folder_ / "study" / "link");
  fs::create_directory_symlink(folder_ / "study", folder_ / "study" / "loop");
  EXPECT_EQ(run(folder_ / "study", "study/case").status, ExitStatus::no_result);
  const Json stage = read_json(folder_ / "study" / "case" / "segmentation" / "stage.json");
  EXPECT_EQ(stage.at("inputs").size(), 12U);
  EXPECT_TRUE(run(folder_ / "study", "study/case").json.at("skipped").get<bool>());
  series.set_pixels(3, std::vector<Uint16>(std::size_t{20} * 24, 7));
  series.write(folder_ / "real");
  EXPECT_FALSE(run(folder_ / "study", "study/case").json.at("skipped").get<bool>());
}

/// A file that arrives while the study is read may have been read and is not noted.
TEST_F(SegmentStage, AStudyThatIsStillBeingCopiedIsRefused) {
  const fs::path study = folder_ / "study";
  fs::copy(data_folder() / "data_samples" / "sample" / "dicom" / "1_od_coronal_t2", study,
           fs::copy_options::recursive);
  std::future<Answer> answer = std::async(std::launch::async, [&] { return run(study, "case"); });
  while (!fs::exists(folder_ / "case" / ".writing-segmentation") &&
         answer.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
  }
  write_file(study / "another.dcm", "late");
  try {
    answer.get();
    FAIL() << "a study that grew was segmented";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_NE(std::string(error.what()).find("files when it was begun"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(fs::exists(folder_ / "case" / "segmentation"));
}

TEST_F(SegmentStage, TheCaseIsNotTheStudysFolder) {
  test::GeneratedSeries().write(folder_ / "study");
  try {
    run(folder_ / "study", "study");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::usage);
  }
  EXPECT_FALSE(fs::exists(folder_ / "study" / "case.json"));
  EXPECT_FALSE(fs::exists(folder_ / "study" / ".lock"));
}

/// Written around one of the study's series, the case would hide the others.
TEST_F(SegmentStage, TheCaseIsNoFolderAroundTheStudyAndOtherFiles) {
  test::GeneratedSeries().write(folder_ / "dicom" / "first");
  write_json(folder_ / "dicom" / "keratometry.json", {});
  EXPECT_EQ(run(folder_ / "dicom" / "first", "dicom").status, ExitStatus::no_result) << "no other images";
  fs::remove_all(folder_ / "dicom");
  test::GeneratedSeries().write(folder_ / "dicom" / "first");
  test::GeneratedSeries("1.2.826.0.1.3680043.9.7.5", 2).write(folder_ / "dicom" / "second");
  const fs::path file = fs::directory_iterator(folder_ / "dicom" / "first" / "scan")->path();
  for (const auto& [study, folder] : {std::pair{folder_ / "dicom" / "first", "dicom"},
                                      std::pair{file, "dicom/first/scan"}, std::pair{file, "dicom"}}) {
    try {
      run(study, folder);
      ADD_FAILURE() << folder;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
    }
    EXPECT_FALSE(fs::exists(folder_ / folder / "case.json"));
  }
}

/// Two visits: the eyes of one are not measured with those of the other, nor at the other's age.
TEST_F(SegmentStage, SeriesOfTwoStudiesAreNotOneEye) {
  test::GeneratedSeries first, second("1.2.826.0.1.3680043.9.7.5", 2);
  second.set_all(DCM_StudyInstanceUID, "1.2.3.4");
  second.set_all(DCM_PatientAge, "041Y");
  first.write(folder_ / "study" / "2020");
  second.write(folder_ / "study" / "2023");
  try {
    run(folder_ / "study", "case");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    for (const char* says : {"(0020,000d)", "1.2.3.4: stack2"})
      EXPECT_NE(std::string(error.what()).find(says), std::string::npos) << error.what();
  }
  EXPECT_FALSE(fs::exists(folder_ / "case"));
  SegmentOptions options;
  options.study = folder_ / "study";
  options.case_folder = folder_ / "case";
  options.series = {parse_series_choice("2")};
  EXPECT_EQ(segment(options, common_).status, ExitStatus::no_result);
  EXPECT_EQ(read_json(folder_ / "case" / "case.json").at("subject").at("age_years"), 41);
}

/// Whoever copies a visit's series into another's study gives both one UID.
TEST_F(SegmentStage, SeriesOfTwoVisitsUnderOneStudyAreRefused) {
  test::GeneratedSeries first, second("1.2.826.0.1.3680043.9.7.5", 2);
  first.set_all(DCM_StudyDate, "20260101");
  second.set_all(DCM_StudyDate, "20290101");
  first.write(folder_ / "study" / "a");
  second.write(folder_ / "study" / "b");
  try {
    run(folder_ / "study", "case");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_NE(std::string(error.what())
                  .find("stack1 and stack2 of one study are of two people or visits: (0008,0020) StudyDate"),
              std::string::npos)
        << error.what();
  }
  SegmentOptions options;
  options.study = folder_ / "study";
  options.case_folder = folder_ / "case";
  options.series = {parse_series_choice("2")};
  EXPECT_EQ(segment(options, common_).status, ExitStatus::no_result);
}

/// DICOM names its patient, NIfTI nobody: what is measured of both is nobody's by name, and only on demand.
TEST_F(SegmentStage, ANiftiVolumeIsNotTheDicomPatients) {
  test::GeneratedSeries series;
  series.write(folder_ / "study");
  const StudyInventory dicom = read_inventory(folder_ / "study", {});
  write_nifti(folder_ / "study" / "other.nii", read_series(dicom, dicom.series.front().uid, {}));
  try {
    run(folder_ / "study", "case");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), testing::HasSubstr("NIfTI volumes (stack1) lie among DICOM series (stack2)"));
    EXPECT_THAT(error.remedy(), testing::HasSubstr("--series"));
  }
  EXPECT_FALSE(fs::exists(folder_ / "case"));
  const Subject patient = dicom.subject_of(dicom.series.front());
  const auto subject = [&](const std::vector<std::string>& chosen) {
    SegmentOptions options;
    options.study = folder_ / "study";
    options.case_folder = folder_ / "case";
    options.series = parse_series_choices(chosen);
    EXPECT_EQ(segment(options, common_).status, ExitStatus::no_result);
    return read_json(folder_ / "case" / "case.json").at("subject");
  };
  EXPECT_EQ(subject({"2"}), to_json(patient));
  for (const std::vector<std::string>& chosen :
       {std::vector<std::string>{"1"}, std::vector<std::string>{"2", "1"}}) {
    const Json told = subject(chosen);
    EXPECT_NE(told.at("id"), patient.id);
    EXPECT_TRUE(told.at("age_years").is_null());
    EXPECT_EQ(told.at("sex"), "");
    EXPECT_THAT(read_json(folder_ / "case" / "segmentation" / "stage.json").at("warnings").dump(),
                testing::HasSubstr("nothing tells that it is of their patient"));
  }
}

TEST_F(SegmentStage, SeveralNiftiVolumesAreWarnedOf) {
  test::GeneratedSeries series;
  series.write(folder_ / "dicom");
  const StudyInventory dicom = read_inventory(folder_ / "dicom", {});
  Stack stack = read_series(dicom, dicom.series.front().uid, {});
  fs::create_directories(folder_ / "study");
  write_nifti(folder_ / "study" / "one.nii", stack);
  stack.slice_intensity[0][0] += 1;
  write_nifti(folder_ / "study" / "two.nii", stack);
  EXPECT_EQ(run(folder_ / "study", "case").status, ExitStatus::no_result);
  EXPECT_THAT(read_json(folder_ / "case" / "segmentation" / "stage.json").at("warnings").dump(),
              testing::HasSubstr("stack1, stack2 are NIfTI volumes, which name no patient"));
}

TEST(SegmentOptions, CheckNamesTheOption) {
  SegmentOptions options;
  options.study = "study";
  options.case_folder = "case";
  // As old as a header may tell.
  options.age_years = 110;
  EXPECT_TRUE(is_plausible_age(110));
  EXPECT_NO_THROW(options.check());
  for (const double years : {-1.0, 111.0}) {
    EXPECT_FALSE(is_plausible_age(years));
    options.age_years = years;
    try {
      options.check();
      ADD_FAILURE() << years;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      EXPECT_EQ(std::string(error.what()).rfind("--age", 0), 0U) << error.what();
    }
  }
}

TEST_F(SegmentStage, NoiseGivesNoEyeButAReason) {
  Stack noise;
  noise.name = "noise";
  noise.columns = noise.rows = 80;
  noise.along_row = Eigen::Vector3d::UnitX();
  noise.along_column = Eigen::Vector3d::UnitY();
  noise.normal = Eigen::Vector3d::UnitZ();
  noise.column_spacing_mm = noise.row_spacing_mm = noise.slice_thickness_mm = 1;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> uniform(0, 100);
  for (int s = 0; s < 40; ++s) {
    noise.slice_position.push_back({-40, -40, s - 20.0});
    noise.slice_intensity.emplace_back();
    for (int i = 0; i < 6400; ++i) noise.slice_intensity.back().push_back(uniform(random));
  }
  fs::create_directories(folder_ / "study");
  write_nifti(folder_ / "study" / "noise.nii.gz", noise);
  const Answer answer = run(folder_ / "study", "case");
  EXPECT_EQ(answer.status, ExitStatus::no_result);
  EXPECT_GE(answer.json.at("reasons").size(), 2U);
  EXPECT_TRUE(fs::exists(folder_ / "case" / "segmentation" / "stage.json"));
  EXPECT_FALSE(fs::exists(folder_ / "case" / "segmentation" / "od" / "fit.json"));
}

/// One person, two contrasts: the same eyes.
TEST_F(SegmentStage, RealScansOfOnePersonAgree) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  ASSERT_EQ(run(fs::path(scans) / "fnndsc_adi_t1_dicom" / "dicom", "t1").status, ExitStatus::done);
  ASSERT_EQ(run(fs::path(scans) / "fnndsc_adi_t2_dicom" / "dicom", "t2").status, ExitStatus::done);
  for (const Laterality laterality : both_eyes) {
    const ParametricEye t1 = eye("t1", laterality), t2 = eye("t2", laterality);
    EXPECT_NEAR(t1.pole_depth_mm(), t2.pole_depth_mm(), 0.5);
    EXPECT_NEAR(t1.globe_semi_axes_mm.x(), t2.globe_semi_axes_mm.x(),
                2 * std::hypot(sigma(t1, "globe_semi_axis_x_mm"), sigma(t2, "globe_semi_axis_x_mm")));
  }
  // A slice is missing through the right eye: it must not shrink by the millimetre that it covers.
  EXPECT_NEAR(2 * eye("t1", Laterality::od).globe_semi_axes_mm.x(), 23.4, 0.4);
}

/// What is blanked are cornea and half of the lens; the back is as somebody read it in the whole head (SOURCE.txt).
TEST_F(SegmentStage, ARealHeadWithoutItsFaceKeepsTheBackOfItsEyes) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  constexpr double plane_y_mm = -72;  // LPS; the apices lie at -78.9 and -77.9
  write_defaced(fs::path(scans) / "phil_elition_t1", plane_y_mm);
  EXPECT_EQ(run(folder_ / "study", "defaced").status, ExitStatus::partial);
  constexpr double read_sigma_mm = 0.5;
  for (const auto& [laterality, width_mm, height_mm] :
       {std::tuple{Laterality::od, 24.8, 23.5}, {Laterality::os, 25.1, 22.7}}) {
    const Json fit = read_json(folder_ / "defaced" / "segmentation" / to_string(laterality) / "fit.json");
    EXPECT_TRUE(fit.at("withheld").contains("front"));
    // By the fit, or where that is withheld by edges.
    const ParametricEye found = eye("defaced", laterality);
    const auto told = [&](const char* edge, double semi_axis_mm, const char* parameter) {
      return fit.at("withheld").contains("fit")
                 ? fit.at("edges").at(edge).get<Measured>()
                 : Measured::from_sigma(2 * semi_axis_mm, 2 * sigma(found, parameter), {});
    };
    for (const auto& [measured, read_mm] :
         {std::pair{told("globe_width_mm", found.globe_semi_axes_mm.x(), "globe_semi_axis_x_mm"), width_mm},
          {told("globe_height_mm", found.globe_semi_axes_mm.y(), "globe_semi_axis_y_mm"), height_mm}})
      EXPECT_NEAR(measured.value, read_mm, 2 * std::hypot(measured.sigma(), read_sigma_mm));
  }
}

/// Of half a globe fits told heights 1.9 mm from the whole head's.
TEST_F(SegmentStage, ARealHeadBlankedThroughItsEyesIsRefusedAsSuch) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  constexpr double plane_y_mm = -34.7;  // LPS; the globes' centres lie at -34.6 and -34.9
  write_defaced(fs::path(scans) / "fnndsc_child_t1_nii", plane_y_mm);
  EXPECT_EQ(run(folder_ / "study", "defaced").status, ExitStatus::no_result);
  for (const Laterality laterality : both_eyes) {
    const Json fit = read_json(folder_ / "defaced" / "segmentation" / to_string(laterality) / "fit.json");
    EXPECT_THAT(fit.at("withheld").at("fit").get<std::string>(),
                testing::HasSubstr("% of the eye's wall was blanked in the images"));
  }
}

TEST_F(SegmentStage, ChildIsMeasuredAndAnUnseenCorneaWithheld) {
  const char* scans = std::getenv("EMMETROPE_REAL_SCANS");
  if (scans == nullptr) GTEST_SKIP() << "EMMETROPE_REAL_SCANS names no folder of real scans";
  EXPECT_EQ(run(fs::path(scans) / "fnndsc_child_t1_nii", "child").status, ExitStatus::done);
  for (const Laterality laterality : both_eyes) {
    const double length = eye("child", laterality).pole_depth_mm();
    EXPECT_GT(length, 21);
    EXPECT_LT(length, 26);
  }
  // Holes in the vitreous and low contrast: nothing of the cornea is in the images.
  EXPECT_EQ(run(fs::path(scans) / "seg3d_t1_nii", "holes").status, ExitStatus::partial);
  for (const Laterality laterality : both_eyes) {
    const Json fit = read_json(folder_ / "holes" / "segmentation" / to_string(laterality) / "fit.json");
    EXPECT_FALSE(fit.at("withheld").empty());
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
