// What else lies in a study's folder.
#include <sys/stat.h>

#include <fstream>

#include "segmentation/intake/nifti.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using ::testing::HasSubstr;

std::string reason_of(const segmentation::StudyInventory& found, const std::string& file) {
  for (const auto& skipped : found.skipped)
    if (skipped.file == file) return skipped.reason;
  return "not skipped";
}

TEST_F(IntakeTest, WhatIsNoImageIsListedAsSkipped) {
  GeneratedSeries series;
  series.write(folder());
  std::ofstream(folder() / "notes.txt")
      << "not a DICOM file, but long enough to hold more than a preamble of one: " << std::string(200, 'x');
  const std::ofstream empty(folder() / "empty.dcm");
  ASSERT_EQ(::mkfifo((folder() / "pipe").c_str(), 0600), 0);
  std::filesystem::create_symlink(folder() / "nowhere", folder() / "dangling");
  std::filesystem::create_directory_symlink(folder(), folder() / "loop");
  std::filesystem::create_symlink(folder() / file_name(3), folder() / "zz-link");
  const auto found = inventory();
  EXPECT_THAT(reason_of(found, "notes.txt"), HasSubstr("not a DICOM file"));
  EXPECT_THAT(reason_of(found, "empty.dcm"), HasSubstr("empty"));
  EXPECT_THAT(reason_of(found, "pipe"), HasSubstr("not a regular file"));
  EXPECT_THAT(reason_of(found, "dangling"), HasSubstr("link to nothing"));
  EXPECT_THAT(reason_of(found, "loop"), HasSubstr("seen already"));
  EXPECT_THAT(reason_of(found, "zz-link"), HasSubstr("seen already"));
  ASSERT_EQ(found.series.size(), 1U);
  EXPECT_TRUE(found.series[0].usable);
  EXPECT_EQ(found.series[0].files, 12U);
}

TEST_F(IntakeTest, OtherDicomObjectsAreSkipped) {
  GeneratedSeries series;
  series.write(folder());
  GeneratedSeries report("1.2.826.0.1.3680043.9.7.8", 8);
  report.set(0, DCM_SOPClassUID, UID_EncapsulatedPDFStorage);
  report[0].findAndDeleteElement(DCM_PixelData);
  report[0].findAndDeleteElement(DCM_Rows);
  ASSERT_TRUE(report.file(0).saveFile((folder() / "report").c_str(), EXS_LittleEndianExplicit).good());
  DcmFileFormat directory;
  directory.getMetaInfo()->putAndInsertString(DCM_MediaStorageSOPClassUID, UID_MediaStorageDirectoryStorage);
  directory.getDataset()->putAndInsertString(DCM_FileSetID, "DISC");
  ASSERT_TRUE(
      directory.getDataset()->putAndInsertString(DCM_SOPClassUID, UID_MediaStorageDirectoryStorage).good());
  directory.getDataset()->putAndInsertString(DCM_SOPInstanceUID, "1.2.3.4");
  ASSERT_TRUE(directory.saveFile((folder() / "DICOMDIR").c_str(), EXS_LittleEndianExplicit).good());
  const auto found = inventory();
  EXPECT_THAT(reason_of(found, "report"), HasSubstr("(0008,0016)"));
  EXPECT_THAT(reason_of(found, "DICOMDIR"), HasSubstr("DICOMDIR"));
  EXPECT_EQ(found.series.size(), 1U);
}

TEST_F(IntakeTest, DataSetsWithoutPreambleAreRead) {
  GeneratedSeries series;
  for (int slice = 0; slice < series.size(); ++slice)
    ASSERT_TRUE(series.file(slice)
                    .saveFile((folder() / std::to_string(slice)).c_str(), EXS_LittleEndianImplicit,
                              EET_UndefinedLength, EGL_recalcGL, EPD_noChange, 0, 0, EWM_dataset)
                    .good());
  expect_generated_volume(read_only_series());
}

TEST_F(IntakeTest, HostileTextsReachNoNamesAndNoIdentity) {
  GeneratedSeries series;
  series.set_all(DCM_PatientID, "../../%n<b>ID");
  series.set_all(DCM_PatientName, "../../%n<b>NAME");
  series.set_all(DCM_SeriesDescription, "../../etc %n%s <script>");
  series.write(folder());
  const auto found = inventory();
  ASSERT_TRUE(found.series.at(0).usable) << found.series[0].reason;
  EXPECT_EQ(found.series[0].name, "stack1");
  const std::string said = to_json(found).dump() + describe(found);
  EXPECT_THAT(said, Not(HasSubstr("%n<b>")));
  EXPECT_EQ(found.subject_of(found.series[0]).id.find_first_not_of("0123456789abcdef"), std::string::npos);
}

TEST_F(IntakeTest, AnEmptyFolderHoldsNoSeries) {
  EXPECT_EQ(inventory().status(), ExitStatus::input_invalid);
  EXPECT_THROW(segmentation::read_inventory(folder() / "missing", quiet()), Error);
}

TEST_F(IntakeTest, TooManyFilesAndTooDeepFoldersAreRefused) {
  GeneratedSeries series;
  series.write(folder() / "1" / "2" / "3");
  auto options = quiet();
  options.limits.files = 5;
  EXPECT_THROW(segmentation::read_inventory(folder(), options), Error);
  options.limits.files = 100;
  options.limits.depth = 2;
  EXPECT_THROW(segmentation::read_inventory(folder(), options), Error);
}

TEST_F(IntakeTest, ACaseInsideItsStudyIsNotReadAgain) {
  GeneratedSeries series;
  series.write(folder() / "dicom");
  series.write(folder() / "case" / "segmentation");
  std::ofstream(folder() / "case" / "case.json") << "{}";
  const auto found = inventory();
  EXPECT_EQ(found.series.size(), 1U);
  EXPECT_THAT(to_json(found).dump(), HasSubstr("a case folder"));
}

/// Two visits in one folder: their series can be used, but each says that there are two studies, and the
/// patient is as old as at the visit.
TEST_F(IntakeTest, TwoStudiesAreTold) {
  GeneratedSeries first, second("1.2.826.0.1.3680043.9.7.5", 2);
  second.set_all(DCM_StudyInstanceUID, "1.2.3.4");
  second.set_all(DCM_PatientAge, "041Y");
  first.write(folder() / "2020");
  second.write(folder() / "2023");
  const auto found = inventory();
  ASSERT_EQ(found.series.size(), 2U);
  for (const auto& info : found.series) {
    EXPECT_TRUE(info.usable);
    EXPECT_THAT(info.warnings, testing::Contains(AllOf(HasSubstr("(0020,000d)"), HasSubstr(info.study_uid),
                                                       HasSubstr("2 studies"), HasSubstr("--series"))));
  }
  EXPECT_EQ(found.subject_of(found.series[0]).age_years, 38);
  EXPECT_EQ(found.subject_of(found.series[1]).age_years, 41);
  EXPECT_NE(found.subject_of(found.series[0]).id, found.subject_of(found.series[1]).id);
}

/// Two patients in one folder: neither's images are taken for the other's.
TEST_F(IntakeTest, SeriesOfTwoPatientsAreRefused) {
  GeneratedSeries first, second("1.2.826.0.1.3680043.9.7.5", 2);
  second.set_all(DCM_PatientID, "SECRET-ID-78");
  first.write(folder() / "a");
  second.write(folder() / "b");
  const auto found = inventory();
  EXPECT_EQ(found.status(), ExitStatus::input_invalid);
  EXPECT_THAT(to_json(found).dump(), AllOf(HasSubstr("(0010,0020)"), HasSubstr("a/scan"), HasSubstr("b/scan"),
                                           Not(HasSubstr("SECRET"))));
}

/// The volume may be either's, or a third person's.
TEST_F(IntakeTest, AVolumeBesideTwoPatientsIsRefusedToo) {
  GeneratedSeries first, second("1.2.826.0.1.3680043.9.7.5", 2);
  second.set_all(DCM_PatientID, "SECRET-ID-78");
  first.write(folder() / "a");
  segmentation::write_nifti(folder() / "scan.nii", read_only_series());
  second.write(folder() / "b");
  const auto found = inventory();
  ASSERT_EQ(found.series.size(), 3U);
  for (const auto& info : found.series) EXPECT_THAT(info.reason, HasSubstr("(0010,0020)"));
  EXPECT_FALSE(found.any_usable());
}

/// One series says neither which patient it is of nor the other's name.
TEST_F(IntakeTest, SeriesOfTwoNamesAreRefusedWhereOneHasNoIdentifier) {
  for (const bool first_has_it : {true, false}) {
    GeneratedSeries with, without("1.2.826.0.1.3680043.9.7.5", 2);
    without.set_all(DCM_PatientID, "");
    without.set_all(DCM_PatientName, "OTHER^NAME");
    (first_has_it ? with : without).write(folder() / "a");
    (first_has_it ? without : with).write(folder() / "b");
    const auto found = inventory();
    EXPECT_EQ(found.status(), ExitStatus::input_invalid);
    EXPECT_THAT(to_json(found).dump(), AllOf(HasSubstr("(0010,0010)"), Not(HasSubstr("OTHER"))));
    std::filesystem::remove_all(folder() / "a");
    std::filesystem::remove_all(folder() / "b");
  }
}

TEST_F(IntakeTest, OneFileIsAStudyToo) {
  GeneratedSeries series;
  const auto files = series.write(folder());
  const auto found = segmentation::read_inventory(files[2], quiet());
  ASSERT_EQ(found.series.size(), 1U);
  EXPECT_EQ(found.series[0].slices.size(), 1U);
}

}  // namespace
}  // namespace emmetrope::test
