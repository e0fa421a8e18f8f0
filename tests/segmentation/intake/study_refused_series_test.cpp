// Studies with one defect each: the series is refused, and the reason names the file and the tag.
#include <dcmtk/dcmdata/dcuid.h>

#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using segmentation::SeriesInfo;
using ::testing::HasSubstr;

struct Defect {
  const char* name;
  void (*make)(GeneratedSeries&);
  const char* tag;  ///< that the reason must name
  ExitStatus status = ExitStatus::input_invalid;
};

class RefusedSeries : public IntakeTest, public ::testing::WithParamInterface<Defect> {};

TEST_P(RefusedSeries, NamesFileAndTag) {
  GeneratedSeries series;
  GetParam().make(series);
  series.write(folder());
  const SeriesInfo info = only_series();
  EXPECT_FALSE(info.usable);
  EXPECT_THAT(info.reason, HasSubstr(GetParam().tag));
  EXPECT_THAT(info.reason, HasSubstr("scan/im"));
  EXPECT_THAT(info.reason, Not(HasSubstr("SECRET")));
  EXPECT_EQ(info.refusal, GetParam().status);
  EXPECT_EQ(inventory().status(), GetParam().status);
  EXPECT_THROW(read_only_series(), Error);
}

constexpr auto turned_slice = [](GeneratedSeries& series) {
  const double angle = 2 * 3.14159265358979 / 180;
  const Eigen::Vector3d row =
      GeneratedSeries::along_row() * std::cos(angle) + GeneratedSeries::along_column() * std::sin(angle);
  const Eigen::Vector3d column =
      GeneratedSeries::along_column() * std::cos(angle) - GeneratedSeries::along_row() * std::sin(angle);
  char text[200];
  std::snprintf(text, sizeof text, "%.9f\\%.9f\\%.9f\\%.9f\\%.9f\\%.9f", row.x(), row.y(), row.z(),
                column.x(), column.y(), column.z());
  series.set(6, DCM_ImageOrientationPatient, text);
};

constexpr auto second_echo = [](GeneratedSeries& series) {
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice)
    series.set(series.duplicate(slice), DCM_EchoTime, "30");
};
constexpr auto phase_images = [](GeneratedSeries& series) {
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice)
    series.set(series.duplicate(slice), DCM_ImageType, "ORIGINAL\\PRIMARY\\P\\ND");
};
constexpr auto second_time = [](GeneratedSeries& series) {
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice) {
    series.set(slice, DCM_TemporalPositionIdentifier, "1");
    series.set(series.duplicate(slice), DCM_TemporalPositionIdentifier, "2");
  }
};
constexpr auto diffusion = [](GeneratedSeries& series) {
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice) {
    series[slice].putAndInsertFloat64(DCM_DiffusionBValue, 0);
    series[series.duplicate(slice)].putAndInsertFloat64(DCM_DiffusionBValue, 1000);
  }
};
constexpr auto one_diffusion_weight = [](GeneratedSeries& series) {
  for (int slice = 0; slice < series.size(); ++slice)
    series[slice].putAndInsertFloat64(DCM_DiffusionBValue, 1000);
};
constexpr auto alternating_echoes = [](GeneratedSeries& series) {
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice)
    series.set(slice, DCM_EchoTime, slice % 2 == 0 ? "12" : "90");
};
constexpr auto alternating_repetitions = [](GeneratedSeries& series) {
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice)
    series.set(slice, DCM_RepetitionTime, slice % 2 == 0 ? "600" : "4000");
};
constexpr auto inverting_lut = [](GeneratedSeries& series) {
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice) {
    DcmItem* table = nullptr;
    series[slice].findOrCreateSequenceItem(DCM_ModalityLUTSequence, table);
    table->putAndInsertString(DCM_ModalityLUTType, "US");
  }
};
constexpr auto sheared = [](GeneratedSeries& series) {
  for (int slice = 0; slice < series.size(); ++slice)
    series.set_position(slice,
                        GeneratedSeries::position(slice) + 0.006 * slice * GeneratedSeries::along_column());
};
constexpr auto far_apart = [](GeneratedSeries& series) {
  for (int slice = 0; slice < series.size(); ++slice)
    series.set_position(slice, GeneratedSeries::position(1000.0 * slice));
};
constexpr auto one_of_other_size = [](GeneratedSeries& series) {
  series.set(4, DCM_Rows, "10");
  series.set_pixels(4, std::vector<Uint16>(std::size_t{10} * GeneratedSeries::columns, 7));
};
constexpr auto half_the_pixels = [](GeneratedSeries& series) {
  series.set_pixels(3, std::vector<Uint16>(240, 7));
};
constexpr auto no_pixels = [](GeneratedSeries& series) { series[3].findAndDeleteElement(DCM_PixelData); };
constexpr auto zero_length_pixels = [](GeneratedSeries& series) { series.set_pixels(3, {}); };
constexpr auto huge_size = [](GeneratedSeries& series) {
  series.set_all(DCM_Rows, "65535");
  series.set_all(DCM_Columns, "65535");
};
constexpr auto wrong_vr = [](GeneratedSeries& series) {
  series[2].findAndDeleteElement(DCM_ImagePositionPatient);
  auto element = std::make_unique<DcmUnsignedShort>(DcmTag(DCM_ImagePositionPatient, EVR_US));
  const Uint16 words[]{1, 2, 3};
  element->putUint16Array(words, 3);
  series[2].insert(element.release());
};

#define SET_ALL(tag, value) [](GeneratedSeries& series) { series.set_all(tag, value); }
#define SET_ONE(tag, value) [](GeneratedSeries& series) { series.set(5, tag, value); }
#define ERASE(tag) [](GeneratedSeries& series) { series.erase_all(tag); }

const Defect defects[] = {
    {"OneSliceTurned", turned_slice, "(0020,0037)"},
    {"TwoEchoes", second_echo, "(0018,0081)"},
    {"MagnitudeAndPhase", phase_images, "(0008,0008)"},
    {"TwoTimes", second_time, "(0020,0100)"},
    {"TwoDiffusionWeights", diffusion, "(0018,9087)"},
    {"AlternatingEchoes", alternating_echoes, "(0018,0081)"},
    {"AlternatingRepetitions", alternating_repetitions, "(0018,0080)"},
    {"ModalityLut", inverting_lut, "(0028,3000)", ExitStatus::unsupported},
    {"SameImageUnderAnotherUid", [](GeneratedSeries& series) { series.duplicate(3); }, "(0020,0032)"},
    {"SameUidOtherContents",
     [](GeneratedSeries& series) {
       const int copy = series.duplicate(3);
       series.set(copy, DCM_SOPInstanceUID, "1.2.826.0.1.3680043.9.7.1.4");
       series.set(copy, DCM_EchoTime, "30");
     },
     "(0008,0018)"},
    {"ShearedStack", sheared, "(0020,0032)"},
    {"TwoPatients", SET_ONE(DCM_PatientID, "SECRET-ID-78"), "(0010,0020)"},
    {"TwoBirthDates", SET_ONE(DCM_PatientBirthDate, "19900101"), "(0010,0030)"},
    {"TwoFramesOfReference", SET_ONE(DCM_FrameOfReferenceUID, "1.2.3"), "(0020,0052)"},
    {"TwoStudiesInOneSeries", SET_ONE(DCM_StudyInstanceUID, "1.2.3"), "(0020,000d)"},
    {"OneSliceOfAnotherSize", one_of_other_size, "(0028,0010)"},
    {"SpacingZero", SET_ALL(DCM_PixelSpacing, "0\\0"), "(0028,0030)"},
    {"SpacingNegative", SET_ALL(DCM_PixelSpacing, "-0.5\\0.4"), "(0028,0030)"},
    {"SpacingNotANumber", SET_ALL(DCM_PixelSpacing, "NaN\\NaN"), "(0028,0030)"},
    {"SpacingOneValue", SET_ALL(DCM_PixelSpacing, "0.5"), "(0028,0030)"},
    {"SpacingAbsent", ERASE(DCM_PixelSpacing), "(0028,0030)"},
    {"SpacingOfAtoms", SET_ALL(DCM_PixelSpacing, "1e-9\\1e-9"), "(0028,0030)"},
    {"SpacingOfHouses", SET_ALL(DCM_PixelSpacing, "2000\\2000"), "(0028,0030)"},
    {"SlicesFarApart", far_apart, "(0020,0032)"},
    {"SpacingDiffers", SET_ONE(DCM_PixelSpacing, "0.5\\0.41"), "(0028,0030)"},
    {"OrientationNotUnit", SET_ALL(DCM_ImageOrientationPatient, "0.97\\0.28\\0\\0\\0\\-1"), "(0020,0037)"},
    {"OrientationNotOrthogonal", SET_ALL(DCM_ImageOrientationPatient, "1\\0\\0\\0.0523\\0.9986\\0"),
     "(0020,0037)"},
    {"OrientationZero", SET_ALL(DCM_ImageOrientationPatient, "0\\0\\0\\0\\0\\0"), "(0020,0037)"},
    {"OrientationAbsent", ERASE(DCM_ImageOrientationPatient), "(0020,0037)"},
    {"PositionAbsent", SET_ONE(DCM_ImagePositionPatient, ""), "(0020,0032)"},
    {"PositionNotANumber", SET_ONE(DCM_ImagePositionPatient, "1\\2\\x"), "(0020,0032)"},
    {"PositionWithCommas", SET_ONE(DCM_ImagePositionPatient, "1,5\\2,5\\3,5"), "(0020,0032)"},
    {"PositionOfWrongVr", wrong_vr, "(0020,0032)"},
    {"SlopeZero", SET_ONE(DCM_RescaleSlope, "0"), "(0028,1053)"},
    {"SlopeNegative", SET_ONE(DCM_RescaleSlope, "-2"), "(0028,1053)"},
    {"SlopeHuge", SET_ALL(DCM_RescaleSlope, "1e300"), "(0028,1053)"},
    {"SlopeNotANumber", SET_ONE(DCM_RescaleSlope, "NaN"), "(0028,1053)"},
    {"InterceptNotANumber", SET_ONE(DCM_RescaleIntercept, "abc"), "(0028,1052)"},
    {"InterceptHuge", SET_ALL(DCM_RescaleIntercept, "1e12"), "(0028,1052)"},
    {"HalfThePixels", half_the_pixels, "(7fe0,0010)"},
    {"NoPixels", no_pixels, "(7fe0,0010)"},
    {"ZeroLengthPixels", zero_length_pixels, "(7fe0,0010)"},
    {"HugeSize", huge_size, "(7fe0,0010)"},
    {"RowsZero", SET_ALL(DCM_Rows, "0"), "(0028,0010)"},
    {"HugeFrames", SET_ALL(DCM_NumberOfFrames, "1000000"), "(0028,0008)", ExitStatus::unsupported},
    {"HighBitBelowBitsStored", SET_ALL(DCM_HighBit, "7"), "(0028,0102)"},
    {"BitsStoredAboveAllocated", SET_ALL(DCM_BitsStored, "20"), "(0028,0101)"},
    {"PixelRepresentationUnknown", SET_ALL(DCM_PixelRepresentation, "2"), "(0028,0103)"},
    {"BitsAllocatedOdd", SET_ALL(DCM_BitsAllocated, "12"), "(0028,0100)", ExitStatus::unsupported},
    {"Monochrome1", SET_ALL(DCM_PhotometricInterpretation, "MONOCHROME1"), "(0028,0004)",
     ExitStatus::unsupported},
    {"Palette", SET_ALL(DCM_PhotometricInterpretation, "PALETTE COLOR"), "(0028,0004)",
     ExitStatus::unsupported},
    {"Colour", SET_ALL(DCM_PhotometricInterpretation, "RGB"), "(0028,0004)", ExitStatus::unsupported},
    {"ThreeSamples", SET_ALL(DCM_SamplesPerPixel, "3"), "(0028,0002)", ExitStatus::unsupported},
    {"SecondaryCapture", SET_ALL(DCM_SOPClassUID, UID_SecondaryCaptureImageStorage), "(0008,0016)",
     ExitStatus::unsupported},
    {"ImageClassOfComputedTomography", SET_ALL(DCM_SOPClassUID, UID_CTImageStorage), "(0008,0016)",
     ExitStatus::unsupported},
    {"ComputedTomography", SET_ALL(DCM_Modality, "CT"), "(0008,0060)", ExitStatus::unsupported},
    {"BurnedInText", SET_ALL(DCM_BurnedInAnnotation, "YES"), "(0028,0301)"},
    {"Mosaic", SET_ALL(DCM_ImageType, "ORIGINAL\\PRIMARY\\M\\ND\\MOSAIC"), "(0008,0008)",
     ExitStatus::unsupported},
    {"Projection", SET_ALL(DCM_ImageType, "DERIVED\\SECONDARY\\PROJECTION IMAGE\\COLLAPSE"), "(0008,0008)",
     ExitStatus::unsupported},
    {"OneProjection", SET_ONE(DCM_ImageType, "ORIGINAL\\PRIMARY\\M\\ND\\MIP"), "(0008,0008)",
     ExitStatus::unsupported},
    {"ProjectionOfMinima", SET_ALL(DCM_ImageType, "DERIVED\\SECONDARY\\MIN IP"), "(0008,0008)",
     ExitStatus::unsupported},
    {"ProjectionByItsTechnique", SET_ALL(DCM_VolumeBasedCalculationTechnique, "MAX_IP"), "(0008,9207)",
     ExitStatus::unsupported},
    {"CurvedPlanes", SET_ALL(DCM_VolumeBasedCalculationTechnique, "CURVED_MPR"), "(0008,9207)",
     ExitStatus::unsupported},
    {"MapOfATime", SET_ALL(DCM_ImageType, "DERIVED\\PRIMARY\\T2 MAP\\ND"), "(0008,0008)",
     ExitStatus::unsupported},
    {"ApparentDiffusion", SET_ALL(DCM_ImageType, "ORIGINAL\\PRIMARY\\ADC_SE\\ADC\\SE"), "(0008,0008)",
     ExitStatus::unsupported},
    {"TraceOfDiffusion", SET_ALL(DCM_ImageType, "DERIVED\\PRIMARY\\M\\TRACEW\\ND\\NORM"), "(0008,0008)",
     ExitStatus::unsupported},
    {"Anisotropy", SET_ALL(DCM_ImageType, "DERIVED\\PRIMARY\\FA\\ND"), "(0008,0008)",
     ExitStatus::unsupported},
    {"Subtraction", SET_ALL(DCM_ImageType, "DERIVED\\PRIMARY\\M\\ND\\SUB"), "(0008,0008)",
     ExitStatus::unsupported},
    {"EchoPlanar", SET_ALL(DCM_ScanningSequence, "EP\\SE"), "(0018,0020)", ExitStatus::unsupported},
    {"EchoPlanarOfEnhancedMr", SET_ALL(DCM_EchoPlanarPulseSequence, "YES"), "(0018,9018)",
     ExitStatus::unsupported},
    {"EchoPlanarByItsName", SET_ALL(DCM_SequenceName, "*ep2d1_128"), "(0018,0024)", ExitStatus::unsupported},
    {"DiffusionByItsName", SET_ALL(DCM_SequenceName, "ep_b1000#2"), "(0018,0024)", ExitStatus::unsupported},
    {"EchoPlanarFunction", SET_ALL(DCM_SequenceName, "epfid2d1_64"), "(0018,0024)", ExitStatus::unsupported},
    {"OneDiffusionWeight", one_diffusion_weight, "(0018,9087)", ExitStatus::unsupported},
};

INSTANTIATE_TEST_SUITE_P(TableA, RefusedSeries, ::testing::ValuesIn(defects),
                         [](const auto& row) { return std::string(row.param.name); });

/// A localizer: three planes in one series.
TEST_F(IntakeTest, ThreePlaneLocalizerIsRefused) {
  GeneratedSeries series;
  for (int slice = 0; slice < 4; ++slice) series.set(slice, DCM_ImageOrientationPatient, "0\\1\\0\\0\\0\\-1");
  for (int slice = 8; slice < 12; ++slice) series.set(slice, DCM_ImageOrientationPatient, "1\\0\\0\\0\\1\\0");
  series.write(folder());
  EXPECT_THAT(only_series().reason, HasSubstr("(0020,0037)"));
}

TEST_F(IntakeTest, ASeriesBeyondTheLimitIsRefused) {
  GeneratedSeries().write(folder());
  auto options = quiet();
  constexpr std::uint64_t bytes_per_voxel = 2;
  options.limits.series_bytes =
      bytes_per_voxel * GeneratedSeries::slices * GeneratedSeries::rows * GeneratedSeries::columns;
  EXPECT_TRUE(segmentation::read_inventory(folder(), options).series.at(0).usable);
  options.limits.series_bytes -= 2;
  const SeriesInfo info = segmentation::read_inventory(folder(), options).series.at(0);
  EXPECT_FALSE(info.usable);
  EXPECT_THAT(info.reason, HasSubstr("12 slices are more than"));
}

/// A series without UID cannot be told from others.
TEST_F(IntakeTest, SeriesWithoutUidIsRefused) {
  GeneratedSeries series;
  series.erase_all(DCM_SeriesInstanceUID);
  series.write(folder());
  EXPECT_THAT(only_series().reason, HasSubstr("(0020,000e)"));
}

}  // namespace
}  // namespace emmetrope::test
