#include "segmentation/intake/sidecar.hpp"

#include "pipeline/base/files.hpp"
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
                       "MRAcquisitionType": "3D", "ScanningSequence": "GR\\IR", "BodyPartExamined": "brain",
                       "ImageType": ["ORIGINAL", "PRIMARY", "M", "ND", "NORM"], "PhaseEncodingDirection": "j-",
                       "PatientName": "Doe", "SeriesDescription": "Doe's", "EchoTrainLength": null})"),
      UnorderedElementsAre(
          Pair("Modality", "MR"), Pair("MagneticFieldStrength", "3"), Pair("PixelBandwidth", "195.3"),
          Pair("FlipAngle", "9"), Pair("RepetitionTime", "2300"), Pair("EchoTime", "2.98"),
          Pair("InversionTime", "900"), Pair("SliceThickness", "1"), Pair("MRAcquisitionType", "3D"),
          Pair("ScanningSequence", "GR\\IR"), Pair("BodyPartExamined", "BRAIN"),
          Pair("ImageType", "ORIGINAL\\PRIMARY\\M\\ND\\NORM"), Pair("InPlanePhaseEncodingDirection", "COL")));
  EXPECT_THAT(warnings(), IsEmpty());
  std::filesystem::remove(folder() / "Doe.json");
  std::vector<std::string> none;
  EXPECT_THAT(segmentation::read_sidecar(volume(), axial(), none), IsEmpty());
  EXPECT_THAT(none, IsEmpty());
}

/// Of the volume as stored, or in the patient's frame, which dcm2niix alone tells of 3-D volumes that it turned.
TEST_F(Sidecar, PhaseEncodingIsAboutTheVolumeAsStored) {
  struct Case {
    const char* json;
    const char* expected;
  };
  const char* sagittal = R"("ImageOrientationPatientDICOM": [0, 1, 0, 0, 0, -1])";
  for (const Case& c : {Case{R"({"PhaseEncodingDirection": "i"})", "ROW"},
                        {R"({"PhaseEncodingAxis": "j"})", "COL"},
                        {R"({"PhaseEncodingDirection": "k-"})", ""},
                        {R"({"InPlanePhaseEncodingDirectionDICOM": "ROW"})", ""},
                        {R"({"InPlanePhaseEncodingDirectionDICOM": "ROW", %})", "COL"},
                        {R"({"InPlanePhaseEncodingDirectionDICOM": "COL", %})", ""}}) {
    std::string json = c.json;
    if (const auto at = json.find('%'); at != std::string::npos) json.replace(at, 1, sagittal);
    const TagValues values = read(json);
    const auto found = values.find("InPlanePhaseEncodingDirection");
    EXPECT_EQ(found == values.end() ? "" : found->second, c.expected) << json;
    EXPECT_THAT(warnings(), IsEmpty());
  }
}

TEST_F(Sidecar, WhatCannotBeReadIsLeftOutWithAWarning) {
  EXPECT_THAT(read(R"({"EchoTime": "short", "PixelBandwidth": -5, "MRAcquisitionType": "4D", "ImageType": [1],
                       "PhaseEncodingDirection": "col_dir", "ImageOrientationPatientDICOM": [1],
                       "InPlanePhaseEncodingDirectionDICOM": "ROW", "FlipAngle": 9})"),
              ElementsAre(Pair("FlipAngle", "9")));
  for (const char* key : {"EchoTime", "PixelBandwidth", "MRAcquisitionType", "ImageType",
                          "PhaseEncodingDirection", "ImageOrientationPatientDICOM"})
    EXPECT_THAT(warnings(),
                Contains(AllOf(HasSubstr("Doe.json: " + std::string(key)), HasSubstr("expected"))));
  for (const std::string& text :
       {std::string("{"), std::string("[]"), std::string(), std::string(100'000, '['),
        std::string("{\"a\": 1, \"a\": 2}"), std::string(1'100'000, ' ')}) {
    EXPECT_THAT(read(text), IsEmpty());
    EXPECT_THAT(warnings(), ElementsAre(AllOf(HasSubstr("Doe.json"), HasSubstr("nothing of it is used"))));
  }
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

TEST_F(Sidecar, WhatIsNoSlicesAsAcquiredIsRefusedWithoutTheFilesName) {
  write_volume(axial());
  for (const char* json :
       {R"({"ScanningSequence": "EP"})", R"({"ScanningSequence": "SE\\EP"})", R"({"Modality": "CT"})",
        R"({"ImageType": ["DERIVED", "PRIMARY", "DIFFUSION", "ADC"]})"}) {
    write_sidecar(json);
    const auto info = only_series();
    EXPECT_FALSE(info.usable) << json;
    EXPECT_EQ(info.refusal, ExitStatus::unsupported);
    EXPECT_THAT(info.reason, HasSubstr("Doe.json: (0")) << json;
    EXPECT_THAT(info.kept.reason, AllOf(HasSubstr("the volume's sidecar: (0"), Not(HasSubstr("Doe"))));
  }
  write_sidecar(R"({"ScanningSequence": "GR_IR", "BodyPartExamined": "KNEE", "EchoTime": "x"})");
  const auto info = only_series();
  EXPECT_TRUE(info.usable);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("KNEE")));
  EXPECT_THAT(info.warnings, Contains(HasSubstr("Doe.json: EchoTime")));
  EXPECT_THAT(info.kept.warnings, Contains(HasSubstr("the volume's sidecar: EchoTime")));
  EXPECT_THAT(info.kept.warnings, Not(Contains(HasSubstr("Doe"))));
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
