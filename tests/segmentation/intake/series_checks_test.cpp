// A series is judged by the images of it that were chosen.
#include "segmentation/intake/series_checks.hpp"

#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

/// An enhanced file whose frames, in turn, are of two stacks.
class ChosenImages : public IntakeTest {
 protected:
  DcmItem& group(int frame, const DcmTagKey& macro) { return functional_group(*file_, frame, macro); }
  /// \param images_with  "KEYWORD=VALUE"; empty: all images
  segmentation::SeriesInfo series(const std::string& images_with = "") const {
    EXPECT_TRUE(file_->saveFile((folder() / "IM_0001").c_str(), EXS_LittleEndianExplicit).good());
    auto options = quiet();
    if (!images_with.empty())
      options.choices = {segmentation::parse_series_choice("1.2.826.0.1.3680043.9.7.2," + images_with)};
    return segmentation::read_inventory(folder(), options).series.at(0);
  }
  static constexpr int frames = GeneratedSeries::slices;
  std::unique_ptr<DcmFileFormat> file_ = enhanced_series(false);
};

TEST_F(ChosenImages, AreThoseWhoseHeadersCount) {
  for (int frame = 0; frame < frames; ++frame) {
    const bool is_second = frame % 2 != 0;
    group(frame, DCM_MREchoSequence).putAndInsertFloat64(DCM_EffectiveEchoTime, is_second ? 90 : 30);
    DcmItem& timing = group(frame, DCM_MRTimingAndRelatedParametersSequence);
    timing.putAndInsertString(DCM_RepetitionTime, is_second ? "4000" : "600");
    timing.putAndInsertString(DCM_FlipAngle, is_second ? "90" : "20");
    group(frame, DCM_PixelMeasuresSequence).putAndInsertString(DCM_SliceThickness, is_second ? "3" : "2");
    group(frame, DCM_FrameAnatomySequence).putAndInsertString(DCM_FrameLaterality, is_second ? "L" : "R");
  }
  EXPECT_FALSE(series().usable);
  const auto second = series("EffectiveEchoTime=90");
  ASSERT_TRUE(second.usable) << second.reason;
  EXPECT_EQ(second.echo_time_ms, 90);
  EXPECT_EQ(second.repetition_time_ms, 4000);
  EXPECT_EQ(second.flip_angle_deg, 90);
  EXPECT_EQ(second.slice_thickness_mm, 3);
  EXPECT_EQ(second.image_laterality, "L");
}

TEST_F(ChosenImages, AloneHaveToBeParallel) {
  for (int frame = 0; frame < frames; ++frame) {
    const bool is_second = frame % 2 != 0;
    group(frame, DCM_FrameContentSequence).putAndInsertString(DCM_StackID, is_second ? "2" : "1");
    if (is_second)
      group(frame, DCM_PlaneOrientationSequence)
          .putAndInsertString(DCM_ImageOrientationPatient, "0\\1\\0\\0\\0\\-1");
  }
  const auto both = series();
  EXPECT_FALSE(both.usable);
  EXPECT_THAT(both.reason, AllOf(HasSubstr("(0020,0037)"), HasSubstr(both.uid + ",StackID=1")));
  const auto first = series("StackID=1");
  EXPECT_TRUE(first.usable) << first.reason;
  EXPECT_EQ(first.slices.size(), 6U);
}

TEST_F(ChosenImages, AreOfOneComponent) {
  for (int frame = 0; frame < frames; ++frame)
    group(frame, DCM_MRImageFrameTypeSequence)
        .putAndInsertString(DCM_ComplexImageComponent, frame % 2 == 0 ? "MAGNITUDE" : "PHASE");
  const auto both = series();
  EXPECT_FALSE(both.usable);
  EXPECT_THAT(both.reason, AllOf(HasSubstr("(0008,9208)"), HasSubstr("MAGNITUDE and PHASE make no stack"),
                                 HasSubstr(",ComplexImageComponent=MAGNITUDE")));
  const auto magnitudes = series("ComplexImageComponent=MAGNITUDE"),
             phases = series("ComplexImageComponent=PHASE");
  EXPECT_TRUE(magnitudes.usable) << magnitudes.reason;
  EXPECT_THAT(magnitudes.warnings, Not(Contains(HasSubstr("phase images"))));
  EXPECT_THAT(phases.warnings, Contains(HasSubstr("phase images")));
}

}  // namespace
}  // namespace emmetrope::test
