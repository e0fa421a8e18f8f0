// What enhanced multi-frame MR says in its functional groups counts as what classic images say.
#include "segmentation/intake/dicom_header.hpp"

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

}  // namespace
}  // namespace emmetrope::test
