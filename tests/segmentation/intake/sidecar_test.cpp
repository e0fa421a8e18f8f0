#include "segmentation/intake/sidecar.hpp"

#include <fmt/format.h>

#include "pipeline/base/files.hpp"
#include "segmentation/intake/canonical_stack.hpp"
#include "segmentation/intake/file_list.hpp"
#include "segmentation/intake/nifti.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using segmentation::Stack;
using segmentation::TagValues;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

class Sidecar : public IntakeTest {
 protected:
  std::filesystem::path volume() const { return folder() / "Doe.nii.gz"; }
  void write_volume(const Stack& stack) const { segmentation::write_nifti(volume(), stack); }
  void write_sidecar(const std::string& text) const { write_file(folder() / "Doe.json", text); }
  TagValues read(const std::string& text) {
    write_sidecar(text);
    warnings_.clear();
    return segmentation::read_sidecar(volume(), axial(), warnings_);
  }
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Cubic voxels of 1 mm, rows to the left, columns to the back.
  static Stack axial() {
    Stack stack;
    stack.columns = stack.rows = 4;
    stack.along_row = Eigen::Vector3d::UnitX();
    stack.along_column = Eigen::Vector3d::UnitY();
    stack.normal = Eigen::Vector3d::UnitZ();
    stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 1;
    for (int slice = 0; slice < 8; ++slice) {
      stack.slice_position.emplace_back(0, 0, slice);
      stack.slice_intensity.emplace_back(16, static_cast<float>(slice));
    }
    return stack;
  }

 private:
  std::vector<std::string> warnings_;
};

TEST_F(Sidecar, TellsTheAcquisitionInUnitsOfDicom) {
  EXPECT_THAT(
      read(R"({"Modality": "MR", "MagneticFieldStrength": 3, "PixelBandwidth": 195.3, "FlipAngle": 9,
                       "RepetitionTime": 2.3, "EchoTime": 0.00298, "InversionTime": 0.9, "SliceThickness": 1,
                       "MRAcquisitionType": "2D", "ScanningSequence": "GR\\IR", "BodyPartExamined": "brain",
                       "ImageType": ["ORIGINAL", "PRIMARY", "", "IN_PHASE"], "PhaseEncodingDirection": "j-",
                       "PatientName": "Doe", "SeriesDescription": "Doe's", "EchoTrainLength": null})"),
      UnorderedElementsAre(
          Pair("Modality", "MR"), Pair("MagneticFieldStrength", "3"), Pair("PixelBandwidth", "195.3"),
          Pair("FlipAngle", "9"), Pair("RepetitionTime", "2300"), Pair("EchoTime", "2.98"),
          Pair("InversionTime", "900"), Pair("SliceThickness", "1"), Pair("MRAcquisitionType", "2D"),
          Pair("ScanningSequence", "GR\\IR"), Pair("BodyPartExamined", "BRAIN"),
          Pair("ImageType", "ORIGINAL\\PRIMARY\\\\IN_PHASE"), Pair("InPlanePhaseEncodingDirection", "COL")));
  EXPECT_THAT(warnings(), IsEmpty());
  EXPECT_THAT(read(R"({"PulseSequenceType": "MPRAGE", "PulseSequenceName": "Doe, Jane"})"), IsEmpty());
  EXPECT_THAT(
      read(R"({"ScanningSequence": "EP_SE", "ImageType": "DERIVED_PRIMARY_MIP", "BodyPartExamined": ""})"),
      UnorderedElementsAre(Pair("ScanningSequence", "EP\\SE"), Pair("ImageType", "DERIVED\\PRIMARY\\MIP")));
  EXPECT_THAT(warnings(), IsEmpty());
  std::filesystem::remove(folder() / "Doe.json");
  std::vector<std::string> none;
  EXPECT_THAT(segmentation::read_sidecar(volume(), axial(), none), IsEmpty());
  EXPECT_THAT(none, IsEmpty());
}

/// dcm2niix turns 3-D volumes to lie as the patient does, and says of the images before that how they lay.
TEST_F(Sidecar, PhaseEncodingAndThicknessAreAboutTheVolumeAsStored) {
  struct Case {
    std::string json, phase;
    bool thickness;
  };
  const std::string axial = R"("ImageOrientationPatientDICOM": [1, 0, 0, 0, 1, 0])",
                    sagittal = R"("ImageOrientationPatientDICOM": [0, 1, 0, 0, 0, -1])",
                    oblique = R"("ImageOrientationPatientDICOM": [0.8, 0.6, 0, -0.6, 0.8, 0])",
                    row = R"("InPlanePhaseEncodingDirectionDICOM": "ROW")",
                    column = R"("InPlanePhaseEncodingDirectionDICOM": "COL")";
  const auto both = [](const std::string& a, const std::string& b) { return fmt::format("{}, {}", a, b); };
  const auto direction = [](const char* axis) {
    return fmt::format("\"PhaseEncodingDirection\": \"{}\"", axis);
  };
  const std::string two = R"("MRAcquisitionType": "2D")", three = R"("MRAcquisitionType": "3D")";
  for (const Case& c : {Case{both(two, direction("i")), "ROW", true},
                        {both(two, R"("PhaseEncodingAxis": "j")"), "COL", true},
                        {both(two, direction("k-")), "", true},
                        {both(three, direction("i")), "", false},
                        {row, "", false},
                        {both(axial, direction("i")), "ROW", true},
                        {both(axial, row), "ROW", true},
                        {both(axial, column), "COL", true},
                        {both(sagittal, row), "ROW\\COL", false},
                        {both(sagittal, column), "ROW", false},
                        {both(sagittal, direction("i")), "", false},
                        {both(oblique, row), "", true}}) {
    TagValues values = read(fmt::format(R"({{"SliceThickness": 1, {}}})", c.json));
    EXPECT_EQ(values["InPlanePhaseEncodingDirection"], c.phase) << c.json;
    EXPECT_EQ(values.count("SliceThickness") > 0, c.thickness) << c.json;
    EXPECT_THAT(warnings(), IsEmpty());
  }
}

/// As seconds the times of a converter that writes milliseconds are those of no sequence.
TEST_F(Sidecar, TimesInMillisecondsAreNotUsed) {
  for (const char* text :
       {R"({"EchoTime": 4.11, "RepetitionTime": 7.2, "InversionTime": 0.9, "FlipAngle": 9})",
        R"({"EchoTime": 0.3, "RepetitionTime": 0.007, "FlipAngle": 9})"}) {
    EXPECT_THAT(read(text), ElementsAre(Pair("FlipAngle", "9"))) << text;
    EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("Doe.json: EchoTime is"), HasSubstr("in seconds?"))));
  }
  EXPECT_THAT(read(R"({"EchoTime": 0.5})"), ElementsAre(Pair("EchoTime", "500")));
  EXPECT_THAT(warnings(), IsEmpty());
}

TEST_F(Sidecar, WhatCannotBeReadIsLeftOutWithAWarning) {
  EXPECT_THAT(read(R"({"EchoTime": "short", "PixelBandwidth": -5, "MRAcquisitionType": "4D", "ImageType": [1],
                       "MagneticFieldStrength": 30000, "ImageOrientationPatientDICOM": [1], "FlipAngle": 9,
                       "InPlanePhaseEncodingDirectionDICOM": "col_dir"})"),
              ElementsAre(Pair("FlipAngle", "9")));
  for (const char* key :
       {"EchoTime", "PixelBandwidth", "MRAcquisitionType", "ImageType", "MagneticFieldStrength",
        "ImageOrientationPatientDICOM", "InPlanePhaseEncodingDirectionDICOM"})
    EXPECT_THAT(warnings(),
                Contains(AllOf(HasSubstr("Doe.json: " + std::string(key)), HasSubstr("expected"))));
  for (const std::string& text :
       {std::string("{"), std::string("[]"), std::string(), std::string(100'000, '['),
        std::string("{\"a\": 1, \"a\": 2}"), std::string(1'100'000, ' ')}) {
    EXPECT_THAT(read(text), IsEmpty());
    EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("Doe.json"), HasSubstr("nothing of it is used"))));
  }
  read(R"({"EchoTime": 0.003, "PatientName": "Mueller^Hans)");
  EXPECT_THAT(warnings(), ElementsAre(Not(HasSubstr("Mueller"))));
}

/// Python writes what JSON does not have.
TEST_F(Sidecar, AFieldThatIsNoNumberIsLeftOutAlone) {
  EXPECT_THAT(read(R"({"EchoTime": NaN, "RepetitionTime": 3, "FlipAngle": -Infinity, "PixelBandwidth": nan,
                       "ImageType": ["ORIGINAL", NaN], "BodyPartExamined": NaN, "Unread": [NaN, 1],
                       "PulseSequenceType": "NaN \"-Infinity\\", "ImageComments": "\\\" NaN", "MRAcquisitionType": "3D"})"),
              UnorderedElementsAre(Pair("RepetitionTime", "3000"), Pair("MRAcquisitionType", "3D")));
  EXPECT_EQ(warnings().size(), 5U);
  for (const char* key : {"EchoTime", "FlipAngle", "PixelBandwidth", "ImageType", "BodyPartExamined"})
    EXPECT_THAT(warnings(), Contains(AllOf(HasSubstr("Doe.json: " + std::string(key) + " is not used"),
                                           HasSubstr("expected"))));
}

/// A volume in the dataset's `anat`, and what it inherits.
class InheritedSidecar : public Sidecar {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(anat());
    segmentation::write_nifti(anat() / "sub-Doe_T1w.nii", axial());
    write_file(anat() / "sub-Doe_T1w.json", R"({"EchoTime": 0.003, "FlipAngle": 9})");
    write_file(folder() / "dataset_description.json", "{}");
    write_file(folder() / "T1w.json",
               R"({"FlipAngle": 12, "MagneticFieldStrength": 3, "RepetitionTime": 2})");
  }
  std::filesystem::path anat() const { return folder() / "sub-Doe" / "anat"; }
  static segmentation::SeriesInfo only_series_of(const std::filesystem::path& study) {
    return segmentation::read_inventory(study, quiet()).series.at(0);
  }
};

/// Also where the study is one visit's folder, as `emmetrope bids` reads it.
TEST_F(InheritedSidecar, TellsWhatTheNearerOneDoesNot) {
  for (const auto& study : {folder(), anat(), anat() / "sub-Doe_T1w.nii"}) {
    const auto info = only_series_of(study);
    EXPECT_EQ(info.flip_angle_deg, 9) << study;
    EXPECT_EQ(info.echo_time_ms, 3) << study;
    EXPECT_EQ(info.field_strength_T, 3) << study;
    EXPECT_EQ(info.repetition_time_ms, 2000) << study;
    EXPECT_EQ(info.files, 3U) << study;
    // A case is stale once it changes.
    const auto files = segmentation::list_files(study, {});
    EXPECT_THAT(files.files, Contains(study == folder() ? "T1w.json" : folder() / "T1w.json")) << study;
  }
  EXPECT_THAT(inventory().skipped,
              ElementsAre(testing::Field(&segmentation::SkippedFile::file, "dataset_description.json")));
}

TEST_F(InheritedSidecar, IsNamedWhereItIsWrong) {
  write_file(folder() / "T1w.json", R"({"FlipAngle": "x", "MagneticFieldStrength": 30000})");
  for (const auto& study : {folder(), anat()}) {
    const auto info = only_series_of(study);
    EXPECT_THAT(info.warnings, Contains(HasSubstr("T1w.json: MagneticFieldStrength is not used")));
    EXPECT_THAT(info.warnings, Not(Contains(HasSubstr("FlipAngle"))));
    EXPECT_THAT(info.kept.warnings,
                Contains(HasSubstr("the volume's sidecar: MagneticFieldStrength is not")));
    EXPECT_THAT(info.kept.warnings, Not(Contains(HasSubstr("T1w.json"))));
  }
  write_file(folder() / "T1w.json", R"({"ScanningSequence": "EP"})");
  for (const auto& study : {folder(), anat()}) {
    const auto info = only_series_of(study);
    EXPECT_EQ(info.refusal, ExitStatus::unsupported);
    EXPECT_THAT(info.reason, HasSubstr("T1w.json: (0018,0020) ScanningSequence is \"EP\""));
    EXPECT_THAT(info.kept.reason,
                AllOf(HasSubstr("the volume's sidecar: (0018,0020)"), Not(HasSubstr("Doe"))));
  }
}

/// git-annex: names of a dataset are links to files that it keeps in a hidden folder, and there under other names.
TEST_F(InheritedSidecar, MayBeALinkAsItsVolumeMay) {
  const std::filesystem::path annex = folder() / ".git" / "annex";
  std::filesystem::create_directories(annex / "a");
  std::filesystem::create_directories(annex / "b");
  const auto keep = [&](const char* name, const char* kept) {
    std::filesystem::rename(anat() / name, annex / kept);
    std::filesystem::create_symlink(annex / kept, anat() / name);
  };
  keep("sub-Doe_T1w.nii", "a/key.nii");
  keep("sub-Doe_T1w.json", "b/key.json");
  const auto info = only_series();
  EXPECT_EQ(info.description, "sub-Doe/anat/sub-Doe_T1w.nii");
  EXPECT_EQ(info.echo_time_ms, 3);
  EXPECT_EQ(info.field_strength_T, 3);
}

TEST_F(Sidecar, SharedByLinksIsReadOfEachVolume) {
  for (const char* name : {"one", "two"}) {
    Stack stack = axial();
    stack.slice_intensity[0][0] = name[0];
    segmentation::write_nifti(folder() / (std::string(name) + ".nii"), stack);
    std::filesystem::remove(folder() / (std::string(name) + ".json"));
    std::filesystem::create_symlink("of_both", folder() / (std::string(name) + ".json"));
  }
  write_file(folder() / "of_both", R"({"EchoTime": 0.091})");
  const auto found = inventory();
  ASSERT_EQ(found.series.size(), 2U);
  for (const auto& info : found.series) EXPECT_EQ(info.echo_time_ms, 91);
  for (const auto& skipped : found.skipped) EXPECT_EQ(skipped.file, "of_both");
}

/// As of git-annex, whose contents were not fetched: of an echo-planar volume nothing would tell that it is one.
TEST_F(Sidecar, ThatIsALinkToNothingIsSaid) {
  write_volume(axial());
  std::filesystem::remove(folder() / "Doe.json");
  std::filesystem::create_symlink("nowhere", folder() / "Doe.json");
  const auto info = only_series();
  EXPECT_TRUE(info.usable);
  EXPECT_EQ(info.files, 1U);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("Doe.json is a link to nothing: nothing of it is used")));
  EXPECT_THAT(info.kept.warnings, Contains(HasSubstr("the volume's sidecar is a link to nothing")));
}

/// DICOM, and what a converter makes of it.
TEST_F(Sidecar, AVolumeIsWhatItsHeadersWere) {
  GeneratedSeries series;
  for (const auto& [tag, value] :
       std::initializer_list<std::pair<DcmTagKey, const char*>>{{DCM_MRAcquisitionType, "2D"},
                                                                {DCM_PixelBandwidth, "130"},
                                                                {DCM_MagneticFieldStrength, "1.5"},
                                                                {DCM_InPlanePhaseEncodingDirection, "ROW"},
                                                                {DCM_SliceThickness, "0.9"}})
    series.set_all(tag, value);
  for (int slice = 0; slice < series.size(); ++slice)
    series.set_position(slice, GeneratedSeries::position(slice * 0.5));
  series.write(folder() / "dicom");
  const auto dicom = segmentation::read_inventory(folder() / "dicom", quiet());
  const Stack acquired = segmentation::read_series(dicom, dicom.series.at(0).uid, quiet());
  std::filesystem::remove_all(folder() / "dicom");
  write_volume(acquired);

  Stack untold = read_only_series();  // beside it lies what write_nifti tells
  EXPECT_TRUE(untold.slices_are_encoded);
  EXPECT_GT(untold.fat_shift_sigma_mm.minCoeff(), 0);
  EXPECT_EQ(only_series().field_strength_T, std::nullopt);

  write_sidecar(
      R"({"MRAcquisitionType": "2D", "PixelBandwidth": 130, "MagneticFieldStrength": 1.5, "SliceThickness": 0.9,
                    "RepetitionTime": 3, "EchoTime": 0.091, "PhaseEncodingDirection": "i",
                    "ImageType": ["ORIGINAL", "PRIMARY", "M", "ND"]})");
  const Stack told = read_only_series();
  EXPECT_FALSE(told.slices_are_encoded);
  EXPECT_TRUE(told.slices_are_told);
  EXPECT_NEAR(told.slice_thickness_mm, acquired.slice_thickness_mm, 1e-6);
  EXPECT_LT((told.fat_shift_sigma_mm - acquired.fat_shift_sigma_mm).norm(), 1e-6);
  EXPECT_EQ(told.fat_shift_sigma_mm.x(), 0);
  const auto by_header = dicom.series.front(), by_sidecar = only_series();
  EXPECT_EQ(by_sidecar.field_strength_T, by_header.field_strength_T);
  EXPECT_EQ(by_sidecar.repetition_time_ms, by_header.repetition_time_ms);
  EXPECT_EQ(by_sidecar.echo_time_ms, by_header.echo_time_ms);
  EXPECT_EQ(by_sidecar.image_type, by_header.image_type);
  EXPECT_THAT(inventory().skipped, IsEmpty());
}

TEST_F(Sidecar, SlicesFarApartAreWarnedOf) {
  GeneratedSeries series;  // 2 mm apart
  series.write(folder() / "dicom");
  const auto dicom = segmentation::read_inventory(folder() / "dicom", quiet());
  const Stack acquired = segmentation::read_series(dicom, dicom.series.at(0).uid, quiet());
  std::filesystem::remove_all(folder() / "dicom");
  write_volume(acquired);
  write_sidecar(R"({"MRAcquisitionType": "2D", "SliceThickness": 0.9})");
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("slices 0.9 mm thick lie 2 mm apart")));
  write_sidecar(R"({"MRAcquisitionType": "2D", "SliceThickness": 1.5})");
  EXPECT_THAT(only_series().warnings, Not(Contains(HasSubstr("apart"))));
}

/// Sagittal images whose volume was turned to axial ones are the same eye's voxels, read out along the same axis.
TEST_F(Sidecar, AVolumeThatWasTurnedIsWhatItWas) {
  Stack acquired;
  acquired.name = "stack1";
  acquired.columns = 6;
  acquired.rows = 7;
  acquired.along_row = Eigen::Vector3d::UnitY();
  acquired.along_column = -Eigen::Vector3d::UnitZ();
  acquired.normal = -Eigen::Vector3d::UnitX();
  acquired.column_spacing_mm = acquired.row_spacing_mm = 1;
  acquired.slice_thickness_mm = 1.2;
  acquired.slices_are_encoded = true;
  const double sigma_mm = 3.5 * 42.577 * 3 / 200;
  acquired.fat_shift_sigma_mm = {0, sigma_mm};  // ROW: read out from the head downwards
  for (int slice = 0; slice < 8; ++slice) {
    acquired.slice_position.push_back(1.2 * slice * acquired.normal);
    acquired.slice_intensity.emplace_back();
    for (int i = 0; i < 42; ++i)
      acquired.slice_intensity.back().push_back(static_cast<float>(100 * slice + i));
  }
  Stack turned = acquired;
  turned.columns = 8;
  turned.rows = 6;
  turned.along_row = acquired.normal;
  turned.along_column = acquired.along_row;
  turned.normal = acquired.along_column;
  turned.column_spacing_mm = 1.2;
  turned.slice_thickness_mm = 1;
  turned.slice_position.clear();
  turned.slice_intensity.clear();
  for (int slice = 0; slice < 7; ++slice) {
    turned.slice_position.push_back(acquired.position(0, slice, 0));
    turned.slice_intensity.emplace_back();
    for (int row = 0; row < 6; ++row)
      for (int column = 0; column < 8; ++column)
        turned.slice_intensity.back().push_back(acquired.at(row, slice, column));
  }
  write_volume(turned);
  write_sidecar(
      R"({"MRAcquisitionType": "3D", "SliceThickness": 1.2, "PixelBandwidth": 200, "MagneticFieldStrength": 3,
                    "ImageOrientationPatientDICOM": [0, 1, 0, 0, 0, -1], "PhaseEncodingDirection": "i",
                    "InPlanePhaseEncodingDirectionDICOM": "ROW"})");
  const Eigen::Vector3d middle = acquired.position(2.5, 3, 4);
  const Stack a = segmentation::canonical_part(acquired, middle, 20),
              b = segmentation::canonical_part(read_only_series(), middle, 20);
  EXPECT_LT((a.along_row - b.along_row).norm() + (a.along_column - b.along_column).norm(), 1e-6);
  EXPECT_EQ(a.slice_intensity, b.slice_intensity);
  EXPECT_LT((a.fat_shift_sigma_mm - b.fat_shift_sigma_mm).norm(), 1e-5);
  EXPECT_NEAR(a.slice_thickness_mm, b.slice_thickness_mm, 1e-6);
  EXPECT_TRUE(b.slices_are_encoded);
  EXPECT_LT((a.slice_position.front() - b.slice_position.front()).norm(), 1e-5);
}

TEST_F(Sidecar, WhatIsNoSlicesAsAcquiredIsRefusedWithoutTheFilesName) {
  write_volume(axial());
  for (const char* json :
       {R"({"ScanningSequence": "EP"})", R"({"ScanningSequence": "EP_GR"})",
        R"({"PulseSequenceType": "Gradient echo EPI"})", R"({"PulseSequenceName": "epi2"})",
        R"({"SequenceName": "_ep2d"})", R"({"Modality": "CT"})",
        R"({"ImageType": ["DERIVED", "PRIMARY", "DIFFUSION", "ADC"]})"}) {
    write_sidecar(json);
    const auto info = only_series();
    EXPECT_FALSE(info.usable) << json;
    EXPECT_EQ(info.refusal, ExitStatus::unsupported);
    EXPECT_THAT(info.reason, HasSubstr("Doe.json: (0")) << json;
    EXPECT_THAT(info.kept.reason, AllOf(HasSubstr("the volume's sidecar: (0"), Not(HasSubstr("Doe"))));
  }
  write_sidecar(R"({"ScanningSequence": "GR_IR", "BodyPartExamined": "Doe Jane", "EchoTime": "x"})");
  const auto info = only_series();
  EXPECT_TRUE(info.usable);
  EXPECT_EQ(info.files, 2);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("BodyPartExamined is not the head")));
  EXPECT_THAT(info.warnings, Contains(HasSubstr("Doe.json: EchoTime")));
  EXPECT_THAT(info.kept.warnings, Contains(HasSubstr("the volume's sidecar: EchoTime")));
  EXPECT_THAT(info.kept.warnings, Not(Contains(HasSubstr("Doe"))));
}

/// Names of files that are no UTF-8 are no less a person's.
TEST_F(Sidecar, NamesOfFilesThatAreNoUtf8AreNotKept) {
  segmentation::write_nifti(folder() / "M\xfcller.nii", axial());
  write_file(folder() / "M\xfcller.json", "{");
  const auto info = only_series();
  ASSERT_THAT(info.kept.warnings, ElementsAre(HasSubstr("the volume's sidecar is no valid JSON")));
  EXPECT_THAT(info.kept.warnings, Not(Contains(HasSubstr("ller"))));
}

/// Its name is too long for a file, or it is a link to itself.
TEST_F(Sidecar, ThatCannotBeThereIsNone) {
  for (const std::string& stem : {std::string(251, 'a'), std::string("loop")}) {
    const std::filesystem::path file = folder() / (stem + ".nii");
    segmentation::write_nifti(folder() / "short.nii", axial());
    std::filesystem::remove(folder() / "short.json");
    std::filesystem::rename(folder() / "short.nii", file);
    if (stem == "loop") std::filesystem::create_symlink("loop.json", folder() / "loop.json");
    EXPECT_TRUE(segmentation::read_inventory(file, quiet()).series.at(0).usable) << stem;
  }
}

/// A case is stale once its volume's sidecar changes, also where the study is one file.
TEST_F(Sidecar, IsAFileOfTheStudy) {
  write_volume(axial());
  write_sidecar("{}");
  for (const auto& study : {folder(), volume()})
    EXPECT_THAT(segmentation::list_files(study, {}).files, UnorderedElementsAre("Doe.json", "Doe.nii.gz"))
        << study;
}

}  // namespace
}  // namespace emmetrope::test
