// What enhanced multi-frame MR says in its functional groups counts as what classic images say; texts come in UTF-8.
#include "segmentation/intake/dicom_header.hpp"

#include <dcmtk/dcmdata/dcuid.h>

#include "segmentation/intake/decoder.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

class FunctionalGroups : public IntakeTest {
 protected:
  static constexpr int frames = GeneratedSeries::slices;
  DcmItem& group(int frame, const DcmTagKey& macro) { return functional_group(*file_, frame, macro); }
  /// The series, where frames have one of two values in turn.
  segmentation::SeriesInfo series_with(const DcmTagKey& macro, const DcmTagKey& attribute, const char* even,
                                       const char* odd) {
    for (int frame = 0; frame < frames; ++frame)
      EXPECT_TRUE(group(frame, macro).putAndInsertString(attribute, frame % 2 == 0 ? even : odd).good());
    return series();
  }
  segmentation::SeriesInfo series() {
    EXPECT_TRUE(file_->saveFile((folder() / "IM_0001").c_str(), EXS_LittleEndianExplicit).good());
    return only_series();
  }
  std::unique_ptr<DcmFileFormat> file_ = enhanced_series(true);
};

TEST_F(FunctionalGroups, TellTheSide) {
  EXPECT_EQ(series().image_laterality, "");
  EXPECT_EQ(series_with(DCM_FrameAnatomySequence, DCM_FrameLaterality, "L", "L").image_laterality, "L");
  EXPECT_EQ(series_with(DCM_FrameAnatomySequence, DCM_FrameLaterality, "L", "R").image_laterality, "B");
}

/// Whoever changes the one may forget the other: sides were swapped, scales were wrong.
TEST_F(FunctionalGroups, OfOneMacroThatIsSharedAndAFramesOwnAreOne) {
  DcmItem* shared = nullptr;
  DcmItem* measures = nullptr;
  ASSERT_TRUE(
      file_->getDataset()->findOrCreateSequenceItem(DCM_SharedFunctionalGroupsSequence, shared, 0).good());
  ASSERT_TRUE(shared->findOrCreateSequenceItem(DCM_PixelMeasuresSequence, measures, 0).good());
  OFString spacing;
  ASSERT_TRUE(measures->findAndGetOFStringArray(DCM_PixelSpacing, spacing).good());
  for (int frame = 0; frame < frames; ++frame)
    group(frame, DCM_PixelMeasuresSequence).putAndInsertOFStringArray(DCM_PixelSpacing, spacing);
  EXPECT_TRUE(series().usable);
  for (int frame = 0; frame < frames; ++frame)
    group(frame, DCM_PixelMeasuresSequence).putAndInsertString(DCM_PixelSpacing, "0.84\\0.84");
  const auto info = series();
  EXPECT_FALSE(info.usable);
  EXPECT_THAT(info.reason, HasSubstr("(0028,0030) PixelSpacing is"));
  EXPECT_THAT(info.reason,
              HasSubstr("in the shared functional groups and \"0.84\\0.84\" in those of a frame"));
}

/// By both a fit knows how far, and along which axis, fat is displaced.
TEST_F(FunctionalGroups, TellBandwidthAndPhaseEncoding) {
  series_with(DCM_MRFOVGeometrySequence, DCM_InPlanePhaseEncodingDirection, "COLUMN", "COLUMN");
  file_->getDataset()->putAndInsertString(DCM_MRAcquisitionType, "3D");
  file_->getDataset()->putAndInsertString(DCM_MagneticFieldStrength, "3");
  for (int frame = 0; frame < frames; ++frame)
    group(frame, DCM_MRImagingModifierSequence).putAndInsertString(DCM_PixelBandwidth, "250");
  const auto info = series();
  EXPECT_EQ(info.pixel_bandwidth_Hz, 250);
  EXPECT_EQ(info.phase_encoding, "COL");
  EXPECT_EQ(info.acquisition_type, "3D");
  const auto stack = read_only_series();
  EXPECT_NEAR(stack.fat_shift_sigma_mm.x(), 0.4 * 3.5 * 42.577 * 3 / 250, 1e-9);
  EXPECT_EQ(stack.fat_shift_sigma_mm.y(), 0);
  EXPECT_TRUE(stack.slices_are_encoded);
  EXPECT_EQ(series_with(DCM_MRFOVGeometrySequence, DCM_InPlanePhaseEncodingDirection, "OTHER", "OTHER")
                .phase_encoding,
            "");
}

TEST_F(FunctionalGroups, TellInversionTimes) {
  const auto put = [&](int frame, double time_ms) {
    group(frame, DCM_MRModifierSequence).putAndInsertFloat64(DCM_InversionTimes, time_ms);
  };
  for (int frame = 0; frame < frames; ++frame) put(frame, 150);
  EXPECT_EQ(series().inversion_time_ms, 150);
  for (int frame = 1; frame < frames; frame += 2) put(frame, 900);
  const auto mixed = series();
  EXPECT_FALSE(mixed.usable);
  EXPECT_THAT(mixed.reason, AllOf(HasSubstr("(0018,9079) InversionTimes is 150 and 900"),
                                  HasSubstr(mixed.uid + ",InversionTimes=150")));
  // Two images at each place.
  for (int frame = 1; frame < frames; frame += 2) {
    OFString place;
    group(frame - 1, DCM_PlanePositionSequence).findAndGetOFStringArray(DCM_ImagePositionPatient, place);
    group(frame, DCM_PlanePositionSequence).putAndInsertString(DCM_ImagePositionPatient, place.c_str());
  }
  EXPECT_THAT(series().reason,
              HasSubstr("the images differ in (0018,9079) InversionTimes (\"150\", \"900\")"));
}

/// What classic images of other contrasts, sequences and sides were converted to is no better than they.
TEST_F(FunctionalGroups, OfALegacyConvertedImageAreThoseOfItsClassicImagesToo) {
  file_->getDataset()->putAndInsertString(DCM_SOPClassUID, UID_LegacyConvertedEnhancedMRImageStorage);
  const DcmTagKey unassigned = DCM_UnassignedPerFrameConvertedAttributesSequence;
  EXPECT_EQ(series_with(unassigned, DCM_Laterality, "L", "L").image_laterality, "L");
  EXPECT_EQ(series_with(unassigned, DCM_RepetitionTime, "3000", "3000").repetition_time_ms, 3000);
  EXPECT_EQ(series_with(unassigned, DCM_PixelBandwidth, "250", "250").pixel_bandwidth_Hz, 250);
  EXPECT_EQ(series_with(unassigned, DCM_InPlanePhaseEncodingDirection, "ROW", "ROW").phase_encoding, "ROW");
  EXPECT_EQ(series_with(unassigned, DCM_MRAcquisitionType, "3D", "3D").acquisition_type, "3D");
  auto info = series_with(unassigned, DCM_InversionTime, "150", "900");
  EXPECT_THAT(info.reason, HasSubstr("(0018,0082) InversionTime is 150 and 900"));
  series_with(unassigned, DCM_InversionTime, "150", "150");
  info = series_with(unassigned, DCM_EchoTime, "30", "90");
  EXPECT_THAT(info.reason, AllOf(HasSubstr("IM_0001 frame"), HasSubstr("(0018,0081) EchoTime is 30 and 90")));
  info = series_with(unassigned, DCM_ScanningSequence, "SE", "EP");
  EXPECT_EQ(info.refusal, ExitStatus::unsupported);
  EXPECT_THAT(info.reason, HasSubstr("(0018,0020)"));
  series_with(unassigned, DCM_ScanningSequence, "SE", "SE");
  info = series_with(unassigned, DCM_ImageType, "DERIVED\\PRIMARY\\T2 MAP", "DERIVED\\PRIMARY\\T2 MAP");
  EXPECT_THAT(info.reason, HasSubstr("(0008,0008)"));
}

TEST_F(FunctionalGroups, OfALegacyConvertedImageMayBeShared) {
  DcmItem *shared = nullptr, *group = nullptr;
  ASSERT_TRUE(
      file_->getDataset()->findOrCreateSequenceItem(DCM_SharedFunctionalGroupsSequence, shared, 0).good());
  ASSERT_TRUE(
      shared->findOrCreateSequenceItem(DCM_UnassignedSharedConvertedAttributesSequence, group, 0).good());
  group->putAndInsertString(DCM_EchoTime, "91");
  EXPECT_EQ(series().echo_time_ms, 91);
  group->putAndInsertString(DCM_ScanningSequence, "EP");
  EXPECT_THAT(series().reason, HasSubstr("(0018,0020)"));
}

/// The C library has no converter for Japanese with escape sequences: the patient's name stood in the description as
/// "$B;3ED(B", and so did it in the report's objects.
TEST_F(IntakeTest, JapaneseWithEscapeSequencesIsConverted) {
  struct Case {
    const char *sets, *name, *description, *expected_name, *expected_description;
  };
  for (const Case& c :
       {Case{"\\ISO 2022 IR 87", "Yamada^Tarou=\x1B$B;3ED\x1B(B^\x1B$BB@O:\x1B(B",
             "\x1B$B;3ED\x1B(B axial T2 yamada", "Yamada^Tarou=\u5c71\u7530^\u592a\u90ce",
             "[removed] axial T2 [removed]"},
        Case{"ISO 2022 IR 13\\ISO 2022 IR 87", "\xD4\xCF\xC0^\xC0\xDB\xB3=\x1B$B;3ED\x1B(J^\x1B$BB@O:\x1B(J",
             "\x1B$B;3ED\x1B(J \xBC\xDD T2",
             "\uff94\uff8f\uff80^\uff80\uff9b\uff73=\u5c71\u7530^\u592a\u90ce", "[removed] \uff7c\uff9d T2"},
        Case{"\\ISO 2022 IR 58", "Wang^XiaoDong=\x1B$)A\xCD\xF5^\x1B$)A\xD0\xA1\xB6\xAB",
             "\x1B$)A\xD0\xA1\xB6\xAB T2", "Wang^XiaoDong=\u738b^\u5c0f\u4e1c", "[removed] T2"}}) {
    GeneratedSeries series;
    series.set_all(DCM_SpecificCharacterSet, c.sets);
    series.set_all(DCM_PatientName, c.name);
    series.set_all(DCM_SeriesDescription, c.description);
    const auto files = series.write(folder());
    EXPECT_EQ(only_series().description, c.expected_description) << c.sets;
    EXPECT_THAT(only_series().warnings, Not(Contains(HasSubstr("(0008,103e)")))) << c.sets;
    const auto header = segmentation::Decoder({}).header(files[0]);
    EXPECT_EQ(header.value(segmentation::tag::patient_name), c.expected_name);
    EXPECT_THAT(header.unreadable, ::testing::IsEmpty());
  }
}

TEST_F(IntakeTest, NoNameIsPassedOnThatIsNotConverted) {
  struct Case {
    const char *sets, *name, *description, *kept_description;
  };
  for (const Case& c :
       {Case{"ISO_IR 100", "Yamada^T=\x1B$B;3ED\x1B(B", "T2 \x1B$B;3ED\x1B(B", ""},  // not told
        Case{"",
             "Sch\xE4"
             "del^A",
             "T2 Sch\xE4"
             "del",
             ""},
        Case{"ISO 2022 IR 100\\ISO 2022 IR 87", "A^\x1B$B;3\x1B(", "T2 Yamada", "T2 Yamada"},
        Case{"\\ISO 2022 IR 87", "Yamada^T=\x1B$(Q.!\x1B(B", "T2 yamada", "T2 [removed]"}}) {
    GeneratedSeries series;
    series.set_all(DCM_SpecificCharacterSet, c.sets);
    series.set_all(DCM_PatientName, c.name);
    series.set_all(DCM_SeriesDescription, c.description);
    const auto files = series.write(folder());
    const auto info = only_series();
    EXPECT_EQ(info.description, c.kept_description) << c.name;
    EXPECT_EQ(info.warnings.size(), std::string(c.kept_description).empty() ? 2U : 1U) << c.name;
    const auto header = segmentation::Decoder({}).header(files[0]);
    EXPECT_FALSE(header.has(segmentation::tag::patient_name)) << c.name;
    EXPECT_THAT(header.unreadable, Contains("PatientName")) << c.name;
  }
}

}  // namespace
}  // namespace emmetrope::test
