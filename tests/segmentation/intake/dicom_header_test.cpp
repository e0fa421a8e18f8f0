// What enhanced multi-frame MR says in its functional groups counts as what classic images say.
#include "segmentation/intake/dicom_header.hpp"

#include <dcmtk/dcmdata/dcuid.h>

#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

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

}  // namespace
}  // namespace emmetrope::test
