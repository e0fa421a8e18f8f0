// Odd but valid studies: voxels and positions must come out exactly.
#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "pipeline/base/files.hpp"
#include "segmentation/intake/slice_grid.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// The one warning of every generated series: its pixels are 0.5 by 0.4 mm, so that rows are told from columns.
const auto only_of_its_pixels =
    ElementsAre(AllOf(HasSubstr("pixels that are not square"), HasSubstr("are wrong by up to 25 %")));

struct Syntax {
  const char* name;
  E_TransferSyntax syntax;
};
class TransferSyntaxes : public IntakeTest, public ::testing::WithParamInterface<Syntax> {};

TEST_P(TransferSyntaxes, AreReadBitForBit) {
  GeneratedSeries series;
  if (is_jpeg2000(GetParam().syntax))
    for (int slice = 0; slice < series.size(); ++slice)
      compress_jpeg2000(series.file(slice),
                        encode_jpeg2000(GeneratedSeries::pixels(slice), GeneratedSeries::rows,
                                        GeneratedSeries::columns, 12),
                        GetParam().syntax);
  series.write(folder(), GetParam().syntax);
  const auto info = only_series();
  EXPECT_TRUE(info.usable) << info.reason;
  EXPECT_THAT(info.warnings, only_of_its_pixels);
  EXPECT_EQ(info.transfer_syntax, DcmXfer(GetParam().syntax).getXferID());
  expect_generated_volume(read_only_series());
}

INSTANTIATE_TEST_SUITE_P(TableA, TransferSyntaxes,
                         ::testing::Values(Syntax{"ImplicitLittleEndian", EXS_LittleEndianImplicit},
                                           Syntax{"ExplicitLittleEndian", EXS_LittleEndianExplicit},
                                           Syntax{"ExplicitBigEndian", EXS_BigEndianExplicit},
                                           Syntax{"Deflated", EXS_DeflatedLittleEndianExplicit},
                                           Syntax{"JpegLossless", EXS_JPEGProcess14},
                                           Syntax{"JpegLosslessFirstOrder", EXS_JPEGProcess14SV1},
                                           Syntax{"JpegLs", EXS_JPEGLSLossless},
                                           Syntax{"Rle", EXS_RLELossless},
                                           Syntax{"Jpeg2000Lossless", EXS_JPEG2000LosslessOnly},
                                           Syntax{"Jpeg2000", EXS_JPEG2000}),
                         [](const auto& row) { return std::string(row.param.name); });

/// JPEG's discrete cosine transform, 12 bits: read, and what was lost is said.
TEST_F(IntakeTest, LossyJpegIsReadAndWarnedOf) {
  GeneratedSeries series;
  std::vector<Uint16> ramp(std::size_t{20} * 24);  // from 0: DCMTK's encoder makes the lowest value 0
  for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = static_cast<Uint16>(100 * (i % 24));
  for (int slice = 0; slice < series.size(); ++slice) series.set_pixels(slice, ramp);
  series.write(folder(), EXS_JPEGProcess2_4);
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("(0028,2110)")));
  const auto stack = read_only_series();
  for (int column = 0; column < 24; ++column) EXPECT_NEAR(stack.at(column, 7, 3), 100 * column, 25) << column;
}

/// NEMA's own sample files say 0 where 63 is meant, the end of the scan's spectral selection; decoders do not need it.
TEST_F(IntakeTest, AScanHeaderOfNoSequentialJpegIsRead) {
  GeneratedSeries series;
  const auto files = series.write(folder(), EXS_JPEGProcess2_4);
  const auto before = read_only_series();
  for (const auto& file : files) {
    std::string bytes = read_file(file);
    // Start of scan, 8 bytes long, of one component: its number and table, Ss, Se, Ah and Al (ITU-T T.81 B.2.3).
    const std::size_t scan = bytes.find(std::string("\xFF\xDA\x00\x08\x01", 5));
    ASSERT_NE(scan, std::string::npos);
    ASSERT_EQ(bytes[scan + 8], 63);
    bytes[scan + 8] = 0;
    std::ofstream(file, std::ios::binary) << bytes;
  }
  EXPECT_TRUE(only_series().usable) << only_series().reason;
  EXPECT_EQ(read_only_series().slice_intensity, before.slice_intensity);
}

TEST_F(IntakeTest, InventorySaysWhatTheSeriesHolds) {
  GeneratedSeries series;
  series.write(folder());
  const auto found = inventory();
  const auto info = found.series.at(0);
  EXPECT_TRUE(info.usable);
  EXPECT_TRUE(info.uniform);
  EXPECT_EQ(info.files, 12U);
  EXPECT_EQ(info.description, "orbit T2");
  EXPECT_DOUBLE_EQ(*info.row_spacing_mm, 0.5);
  EXPECT_DOUBLE_EQ(*info.column_spacing_mm, 0.4);
  EXPECT_NEAR(*info.slice_spacing_mm, 2, 1e-9);
  double sum = 0, lowest = 1e9, highest = 0;
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice)
    for (const double value : GeneratedSeries::pixels(slice)) {
      sum += value;
      lowest = std::min(lowest, value);
      highest = std::max(highest, value);
    }
  EXPECT_EQ(info.minimum, lowest);
  EXPECT_EQ(info.maximum, highest);
  EXPECT_NEAR(*info.mean, sum / (12 * 20 * 24), 1e-9);
  EXPECT_LT((info.slices.front().position_mm - GeneratedSeries::position(0)).norm(), 1e-6);
  EXPECT_LT((info.slices.back().position_mm - GeneratedSeries::position(11)).norm(), 1e-6);
  EXPECT_EQ(found.subject_of(found.series[0]).age_years, 38);
  EXPECT_EQ(found.subject_of(found.series[0]).sex, "F");
  EXPECT_EQ(found.status(), ExitStatus::done);
  EXPECT_THAT(to_json(found).dump(), Not(HasSubstr("SECRET")));
}

TEST_F(IntakeTest, MissingSliceLeavesAGapAndIsNamed) {
  GeneratedSeries series;
  series.remove(7);
  const auto files = series.write(folder());
  const auto info = only_series();
  EXPECT_TRUE(info.usable);
  EXPECT_FALSE(info.uniform);
  EXPECT_NEAR(*info.slice_spacing_mm, 2, 1e-9);
  EXPECT_THAT(info.warnings,
              Contains(AllOf(HasSubstr("(0020,0032)"), HasSubstr(file_name(6)), HasSubstr(file_name(7)))));
  const auto stack = read_only_series();
  ASSERT_EQ(stack.slices(), 11);
  EXPECT_LT((stack.slice_position[6] - GeneratedSeries::position(6)).norm(), 1e-6);
  EXPECT_LT((stack.slice_position[7] - GeneratedSeries::position(8)).norm(), 1e-6);
}

TEST_F(IntakeTest, UnevenSlicesKeepTheirPositionsAndAreWarnedOf) {
  GeneratedSeries series;
  series.set_position(5, GeneratedSeries::position(5.25));
  series.write(folder());
  const auto info = only_series();
  EXPECT_TRUE(info.usable);
  EXPECT_FALSE(info.uniform);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("uneven spacing")));
  EXPECT_LT((read_only_series().slice_position[5] - GeneratedSeries::position(5.25)).norm(), 1e-6);
}

/// A slice moved by half the spacing made a grid of half the spacing, on which every second slice was missing.
TEST_F(IntakeTest, ASliceBetweenThePlanesOfAllOthersIsNamed) {
  for (const double place : {5.5, 5.25, 4.4}) {
    GeneratedSeries series;
    series.set_position(5, GeneratedSeries::position(place));
    series.write(folder());
    EXPECT_THAT(only_series().warnings,
                Contains(AllOf(HasSubstr("uneven spacing: " + file_name(5) + ": (0020,0032)"),
                               HasSubstr("off the grid of 2.000 mm on which all other slices lie"))));
    EXPECT_THAT(only_series().warnings, Not(Contains(HasSubstr("missing"))));
  }
  // A slice that is missing elsewhere is said all the same.
  GeneratedSeries series;
  series.set_position(5, GeneratedSeries::position(5.5));
  series.remove(8);
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("uneven spacing: " + file_name(5))));
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("1 slice is missing between")));
}

TEST_F(IntakeTest, OfManyGapsTheFirstAreToldSinglyAndTheRestTogether) {
  GeneratedSeries series;
  for (int slice = 6; slice < GeneratedSeries::slices; ++slice)
    series.set_position(slice, GeneratedSeries::position(3.0 * slice - 12));
  series.write(folder());
  const auto warnings = only_series().warnings;
  EXPECT_EQ(
      std::count_if(warnings.begin(), warnings.end(),
                    [](const auto& text) { return text.find("slices are missing between") != text.npos; }),
      4);
  EXPECT_THAT(warnings, Contains("missing slices in other gaps: 2"));
}

/// Its sign and origin are each vendor's; of slices that were exchanged it tells another order than the positions.
TEST_F(IntakeTest, SlicesInAnotherOrderThanTheirLocationsAreNamed) {
  const auto of_locations = HasSubstr("(0020,1041) SliceLocation");
  for (const double sign : {1.0, -1.0}) {
    GeneratedSeries series;
    for (int slice = 0; slice < series.size(); ++slice)
      series.set(slice, DCM_SliceLocation, fmt::format("{:.3f}", sign * 2 * slice - 31.5));
    series.write(folder());
    EXPECT_THAT(only_series().warnings, only_of_its_pixels);
    series.set_position(3, GeneratedSeries::position(8));
    series.set_position(8, GeneratedSeries::position(3));
    series.write(folder());
    const auto info = only_series();
    EXPECT_TRUE(info.usable) << info.reason;
    EXPECT_THAT(
        info.warnings,
        Contains(AllOf(HasSubstr(file_name(8) + " and " + file_name(3)), of_locations,
                       HasSubstr(fmt::format("is {:g} and {:g} mm", sign * 16 - 31.5, sign * 6 - 31.5)),
                       HasSubstr("(0020,0032)"), HasSubstr("exchanged"))));
    // Where only some tell it, by those; where all tell the same, it tells nothing.
    series[0].findAndDeleteElement(DCM_SliceLocation);
    series.write(folder());
    EXPECT_THAT(only_series().warnings, Contains(of_locations));
    series.set_all(DCM_SliceLocation, "0");
    series.write(folder());
    EXPECT_THAT(only_series().warnings, only_of_its_pixels);
  }
}

/// What is not seen there was taken for disease in both eyes.
TEST_F(IntakeTest, LostSlicesAreNamed) {
  const std::vector<Uint16> nothing(std::size_t{GeneratedSeries::rows} * GeneratedSeries::columns, 0);
  GeneratedSeries series;
  series.set_pixels(0, nothing);
  series.set_pixels(11, nothing);
  series.write(folder());
  EXPECT_THAT(only_series().warnings, only_of_its_pixels);  // beyond the head
  series.set_pixels(5, nothing);
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr(file_name(5) + ": one value throughout")));
  series.set_pixels(5, GeneratedSeries::pixels(8));
  series.write(folder());
  EXPECT_THAT(only_series().warnings,
              Contains(HasSubstr(file_name(5) + " and " + file_name(8) + ": the same pixels at two places")));
}

TEST_F(IntakeTest, ScalesThatContradictTheImagesAreWarnedOf) {
  GeneratedSeries series;
  for (int slice = 0; slice < series.size(); ++slice) {
    // As Philips does: what the scale takes the stored values give.
    const unsigned factor = slice % 2 == 0 ? 1 : 2;
    auto words = GeneratedSeries::pixels(slice);
    for (auto& word : words) word = static_cast<Uint16>(word / factor);
    series.set_pixels(slice, words);
    series.set(slice, DCM_RescaleSlope, std::to_string(factor));
    series.set(slice, DCM_RescaleIntercept, "0");
  }
  series.write(folder());
  EXPECT_THAT(only_series().warnings, only_of_its_pixels);
  for (int slice = 0; slice < series.size(); ++slice)
    series.set_pixels(slice, GeneratedSeries::pixels(slice));
  series.write(folder());
  EXPECT_THAT(only_series().warnings,
              Contains(HasSubstr("(0028,1053) RescaleSlope is \"2\", and the slice is brighter")));
  for (int slice = 0; slice < series.size(); slice += 2) series[slice].findAndDeleteElement(DCM_RescaleSlope);
  series.write(folder());
  EXPECT_THAT(only_series().warnings,
              Contains(AllOf(HasSubstr(file_name(1) + ": (0028,1053) RescaleSlope is \"2\""),
                             HasSubstr(file_name(0) + ": (0028,1053) RescaleSlope is absent"))));
}

TEST_F(IntakeTest, RoundingOfPositionsIsNoUnevenness) {
  GeneratedSeries series;
  for (int slice = 0; slice < series.size(); ++slice)
    series.set_position(slice, GeneratedSeries::position(slice + (slice % 2 == 0 ? 0.004 : -0.004)));
  series.write(folder());
  EXPECT_TRUE(only_series().uniform);
  EXPECT_THAT(only_series().warnings, only_of_its_pixels);
}

TEST_F(IntakeTest, ADisplacedSliceKeepsItsPlace) {
  GeneratedSeries series;
  series.set_position(5, GeneratedSeries::position(5) + 0.05 * GeneratedSeries::along_row());
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("off one line")));
  EXPECT_FALSE(only_series().uniform);
}

TEST_F(IntakeTest, CopiesOfAFileCountOnce) {
  GeneratedSeries series;
  const auto files = series.write(folder());
  std::filesystem::copy_file(files[3], folder() / "zz-copy");
  const auto found = inventory();
  EXPECT_EQ(found.series.at(0).files, 12U);
  EXPECT_TRUE(found.series.at(0).usable);
  EXPECT_THAT(found.series.at(0).warnings, Contains(HasSubstr("(0008,0018)")));
  ASSERT_EQ(found.skipped.size(), 1U);
  expect_generated_volume(read_only_series());
}

TEST_F(IntakeTest, SeriesAreNeverMerged) {
  GeneratedSeries first, second("1.2.826.0.1.3680043.9.7.5", 5);
  for (int slice = 0; slice < second.size(); ++slice)
    second.set_position(slice, GeneratedSeries::position(slice + 0.5));
  first.write(folder() / "a");
  second.write(folder() / "a" / "b");
  const auto found = inventory();
  ASSERT_EQ(found.series.size(), 2U);
  EXPECT_TRUE(found.series[0].usable);
  EXPECT_TRUE(found.series[1].usable);
  EXPECT_EQ(found.series[0].name, "stack1");
  EXPECT_EQ(found.series[1].name, "stack2");
  EXPECT_EQ(segmentation::read_series(found, found.series[1].uid, quiet()).slices(), 12);
  EXPECT_THROW(found.find("1.2.3"), Error);
}

/// As many as an explicit length allows.
TEST_F(IntakeTest, AnImageTypeMayHaveThousandsOfWords) {
  std::string type = "DERIVED\\PRIMARY\\M";
  for (int i = 0; i < 10'000; ++i) type += "\\NONE";
  GeneratedSeries series;
  series.set_all(DCM_ImageType, type);
  series.write(folder());
  EXPECT_FALSE(only_series().computed);
  EXPECT_TRUE(only_series().usable);
}

TEST_F(IntakeTest, AFieldThatNoScannerHasIsNotUsed) {
  GeneratedSeries series;
  series.set_all(DCM_MagneticFieldStrength, "30000");
  series.set_all(DCM_PixelBandwidth, "0.0001");
  series.write(folder());
  const auto info = only_series();
  EXPECT_EQ(info.field_strength_T, std::nullopt);
  EXPECT_EQ(info.pixel_bandwidth_Hz, std::nullopt);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("(0018,0087) MagneticFieldStrength is \"30000\"")));
  EXPECT_THAT(info.warnings, Contains(HasSubstr("(0018,0095) PixelBandwidth is \"0.0001\"")));
}

TEST_F(IntakeTest, SlicesOf3DAcquisitionsAreEncoded) {
  struct Case {
    const char* type;
    double spacing_mm;
    bool encoded;
  };
  // Where the header does not tell, thin ones are.
  for (const Case& c :
       {Case{"2D", 1, false}, {"3D", 1, true}, {"3D", 2, true}, {"", 1, true}, {"", 2, false}}) {
    GeneratedSeries series;
    series.set_all(DCM_MRAcquisitionType, c.type);
    for (int slice = 0; slice < series.size(); ++slice)
      series.set_position(
          slice, GeneratedSeries::position(slice * c.spacing_mm / GeneratedSeries::slice_spacing_mm));
    const std::filesystem::path study = folder() / fmt::format("{}_{}", c.type, c.spacing_mm);
    series.write(study);
    const auto found = segmentation::read_inventory(study, quiet());
    const auto stack = segmentation::read_series(found, found.series.at(0).uid, quiet());
    EXPECT_EQ(stack.slices_are_encoded, c.encoded) << study;
    EXPECT_EQ(stack.slices_are_told, !c.encoded) << study;
  }
}

TEST_F(IntakeTest, AnImageOfSeveralCanBeChosen) {
  GeneratedSeries series;
  for (int slice = 0; slice < GeneratedSeries::slices; ++slice) {
    const int copy = series.duplicate(slice);
    series.set(copy, DCM_EchoTime, "30");
    series.set_pixels(copy,
                      std::vector<Uint16>(std::size_t{GeneratedSeries::rows} * GeneratedSeries::columns, 5));
  }
  series.write(folder());
  auto options = quiet();
  options.choices = {segmentation::parse_series_choice("1.2.826.0.1.3680043.9.7.1,EchoTime=91")};
  const auto found = segmentation::read_inventory(folder(), options);
  ASSERT_TRUE(found.series.at(0).usable) << found.series.at(0).reason;
  expect_generated_volume(segmentation::read_series(found, found.series[0].uid, options));
}

TEST_F(IntakeTest, RescaleIsAppliedPerSlice) {
  GeneratedSeries series;
  for (int slice = 0; slice < series.size(); ++slice) {
    series.set(slice, DCM_RescaleSlope, std::to_string(0.25 * (slice + 1)));
    series.set(slice, DCM_RescaleIntercept, std::to_string(-slice));
  }
  series.write(folder());
  const auto stack = read_only_series();
  for (int slice = 0; slice < stack.slices(); ++slice)
    EXPECT_FLOAT_EQ(stack.at(3, 4, slice), 0.25F * (slice + 1) * GeneratedSeries::value(3, 4, slice) - slice);
  EXPECT_EQ(only_series().minimum, 0.25 * 100);
}

TEST_F(IntakeTest, PhilipsPrivateScalingIsRecordedOnly) {
  GeneratedSeries series;
  for (int slice = 0; slice < series.size(); ++slice) {
    series[slice].putAndInsertString(DcmTag(0x2005, 0x0010, EVR_LO), "Philips MR Imaging DD 001");
    series[slice].putAndInsertFloat32(DcmTag(0x2005, 0x100d, EVR_FL), 3);
    series[slice].putAndInsertFloat32(DcmTag(0x2005, 0x100e, EVR_FL), 0.5F);
  }
  series.write(folder());
  ASSERT_TRUE(only_series().private_scaling);
  EXPECT_EQ((*only_series().private_scaling)[0], 0.5);
  expect_generated_volume(read_only_series());
}

TEST_F(IntakeTest, SignedSamplesAreExtended) {
  GeneratedSeries series;
  series.set_all(DCM_PixelRepresentation, "1");
  for (int slice = 0; slice < series.size(); ++slice) {
    auto words = GeneratedSeries::pixels(slice);
    for (auto& word : words) word = static_cast<Uint16>(word - 3000) & 0x0FFF;
    series.set_pixels(slice, words);
  }
  series.write(folder());
  const auto stack = read_only_series();
  const auto expected = [](int value) { return value - 3000 < -2048 ? value - 3000 + 4096 : value - 3000; };
  for (int column = 0; column < 24; ++column)
    EXPECT_EQ(stack.at(column, 2, 9), expected(GeneratedSeries::value(column, 2, 9)));
  EXPECT_THAT(only_series().warnings, only_of_its_pixels);
}

TEST_F(IntakeTest, BitsAboveTheStoredOnesAreMaskedAndWarnedOf) {
  GeneratedSeries series;
  auto words = GeneratedSeries::pixels(4);
  for (auto& word : words) word |= 0xF000;
  series.set_pixels(4, words);
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(AllOf(HasSubstr("(0028,0101)"), HasSubstr(file_name(4)))));
  expect_generated_volume(read_only_series());
}

TEST_F(IntakeTest, AHighBitAboveTheStoredOnesIsShifted) {
  GeneratedSeries series;
  series.set_all(DCM_HighBit, "15");
  for (int slice = 0; slice < series.size(); ++slice) {
    auto words = GeneratedSeries::pixels(slice);
    for (auto& word : words) word = static_cast<Uint16>(word << 4);
    series.set_pixels(slice, words);
  }
  series.write(folder());
  expect_generated_volume(read_only_series());
}

TEST_F(IntakeTest, EightBitSamplesAreRead) {
  GeneratedSeries series;
  series.set_all(DCM_BitsAllocated, "8");
  series.set_all(DCM_BitsStored, "8");
  series.set_all(DCM_HighBit, "7");
  std::vector<Uint8> bytes(std::size_t{20} * 24);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<Uint8>(i % 251);
  for (int slice = 0; slice < series.size(); ++slice)
    series[slice].putAndInsertUint8Array(DCM_PixelData, bytes.data(), bytes.size());
  series.write(folder());
  const auto stack = read_only_series();
  EXPECT_EQ(stack.at(23, 19, 3), 479 % 251);
  EXPECT_EQ(stack.at(1, 0, 0), 1);
}

TEST_F(IntakeTest, PixelDataMayBeLongerButThatIsSaid) {
  GeneratedSeries series;
  auto words = GeneratedSeries::pixels(2);
  words.resize(words.size() + 8);
  series.set_pixels(2, words);
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(AllOf(HasSubstr("(7fe0,0010)"), HasSubstr(file_name(2)))));
  expect_generated_volume(read_only_series());
}

TEST_F(IntakeTest, OrientationIsMadeOrthonormal) {
  GeneratedSeries series;
  series.set_all(DCM_ImageOrientationPatient, "0.9602\\0.2801\\0\\0\\0\\-1");
  series.write(folder());
  const auto stack = read_only_series();
  EXPECT_NEAR(stack.along_row.norm(), 1, 1e-12);
  EXPECT_NEAR(stack.along_row.dot(stack.along_column), 0, 1e-12);
}

TEST_F(IntakeTest, ADisagreeingSliceSpacingIsWarnedOfAndNotUsed) {
  GeneratedSeries series;
  series.set_all(DCM_SpacingBetweenSlices, "2.4");
  series.set_all(DCM_SliceThickness, "4");
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("(0018,0088)")));
  expect_generated_volume(read_only_series());
  EXPECT_EQ(read_only_series().slice_thickness_mm, 4);
}

/// Sagittal localisers: 2 mm apart in these series.
TEST_F(IntakeTest, SlicesFarApartAreWarnedOf) {
  GeneratedSeries series;
  series.set_all(DCM_SliceThickness, "0.9");
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("slices 0.9 mm thick lie 2 mm apart")));
  series.set_all(DCM_SliceThickness, "1.5");
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Not(Contains(HasSubstr("apart"))));
}

TEST_F(IntakeTest, SlicesMuchThickerThanTheirSpacingAreWarnedOf) {
  GeneratedSeries series;
  series.set_all(DCM_SliceThickness, "12");
  series.write(folder());
  EXPECT_THAT(
      only_series().warnings,
      Contains(HasSubstr("slices 12 mm thick lie 2 mm apart: (0018,0050) SliceThickness may be wrong")));
  series.set_all(DCM_SliceThickness, "8");
  series.write(folder());
  EXPECT_THAT(only_series().warnings, only_of_its_pixels);
}

/// Rows run to the left and somewhat to the back, columns to the feet.
TEST_F(IntakeTest, AnOrientationInLettersThatContradictsTheCosinesIsWarnedOf) {
  for (const auto& [letters, contradicts] : {std::pair{"L\\F", false},
                                             {"LP\\F", false},
                                             {"PL\\F", false},
                                             {"R\\F", true},
                                             {"L\\H", true},
                                             {"", false}}) {
    GeneratedSeries series;
    series.set_all(DCM_PatientOrientation, letters);
    series.write(folder());
    EXPECT_TRUE(only_series().usable);
    if (contradicts)
      EXPECT_THAT(only_series().warnings,
                  Contains(HasSubstr("(0020,0020) PatientOrientation contradicts (0020,0037)")))
          << letters;
    else
      EXPECT_THAT(only_series().warnings, only_of_its_pixels) << letters;
  }
}

TEST_F(IntakeTest, LossyCompressionIsWarnedOf) {
  GeneratedSeries series;
  series.set(3, DCM_LossyImageCompression, "01");
  series.write(folder());
  EXPECT_TRUE(only_series().usable);
  EXPECT_THAT(only_series().warnings, Contains(AllOf(HasSubstr("(0028,2110)"), HasSubstr(file_name(3)))));
}

TEST_F(IntakeTest, AChoiceOfAnAbsentSeriesIsAnError) {
  GeneratedSeries series;
  series.write(folder());
  auto options = quiet();
  options.choices = {segmentation::parse_series_choice("1.2.3,EchoTime=91")};
  EXPECT_THROW(segmentation::read_inventory(folder(), options), Error);
}

TEST_F(IntakeTest, LateralityIsThatOfAllItsImages) {
  GeneratedSeries series;
  series.set_all(DCM_Laterality, "L");
  series.write(folder());
  EXPECT_EQ(only_series().image_laterality, "L");
  series.set(3, DCM_ImageLaterality, "R");
  series.write(folder());
  EXPECT_EQ(only_series().image_laterality, "B");
}

TEST_F(IntakeTest, AnAgeThatIsNobodysIsWarnedOfAndNotUsed) {
  for (const char* age : {"999Y", "111Y", "000Y", "000D", "-05Y", "38"}) {
    GeneratedSeries series;
    series.set_all(DCM_PatientAge, age);
    series.write(folder());
    const auto found = inventory();
    ASSERT_TRUE(found.series.at(0).usable);
    EXPECT_THAT(found.series[0].warnings, Contains(HasSubstr("(0010,1010)"))) << age;
    EXPECT_FALSE(found.subject_of(found.series[0]).age_years) << age;
  }
}

TEST_F(IntakeTest, AThicknessThatIsNoSlicesIsWarnedOfAndNotUsed) {
  GeneratedSeries series;
  series.set_all(DCM_SliceThickness, "2000");
  series.write(folder());
  EXPECT_THAT(only_series().warnings, Contains(HasSubstr("(0018,0050)")));
  EXPECT_NEAR(read_only_series().slice_thickness_mm, GeneratedSeries::slice_spacing_mm, 1e-6);
}

TEST_F(IntakeTest, SequencesWithoutDiffusionAndEchoPlanarReadoutAreRead) {
  for (const char* name : {"*tse2d1_19", "*tfl3d1_16ns", "r73d4_ns", "step3d"}) {
    GeneratedSeries series;
    series.set_all(DCM_SequenceName, name);
    for (int slice = 0; slice < series.size(); ++slice)
      series[slice].putAndInsertFloat64(DCM_DiffusionBValue, 0);
    series.write(folder());
    EXPECT_TRUE(only_series().usable) << only_series().reason;
    EXPECT_THAT(only_series().warnings, only_of_its_pixels);
  }
}

TEST_F(IntakeTest, AnEchoAfterTheRepetitionIsWarnedOf) {
  GeneratedSeries series;
  series.set_all(DCM_RepetitionTime, "7.2");
  series.write(folder());
  EXPECT_THAT(only_series().warnings,
              Contains(HasSubstr("(0018,0081) EchoTime is 91 ms, longer than (0018,0080) RepetitionTime")));
  series.set_all(DCM_RepetitionTime, "0");  // not told
  series.write(folder());
  EXPECT_THAT(only_series().warnings, only_of_its_pixels);
}

TEST_F(IntakeTest, AnotherBodyPartIsWarnedOf) {
  const auto warnings = [&](const char* part) {
    GeneratedSeries series;
    series.set_all(DCM_BodyPartExamined, part);
    series.write(folder());
    EXPECT_TRUE(only_series().usable);
    return only_series().warnings;
  };
  for (const char* part : {"KNEE", "SURFACE", "FACET JOINT"})
    EXPECT_THAT(warnings(part), Contains(HasSubstr("(0018,0015)"))) << part;
  for (const char* part : {"HEAD", "HEADNECK", "WHOLEHEAD", "NECK FACE", "ORBITS"})
    EXPECT_THAT(warnings(part), only_of_its_pixels);
}

TEST_F(IntakeTest, ImagesThatWereComputedFromOthersAreWarnedOf) {
  const auto series_of = [&](const char* type) {
    GeneratedSeries series;
    series.set_all(DCM_ImageType, type);
    series.write(folder());
    return only_series();
  };
  for (const char* type :
       {"DERIVED\\SECONDARY\\MPR\\CSA MPR\\M\\ND", "DERIVED\\SECONDARY\\REFORMATTED\\AVERAGE",
        "DERIVED\\PRIMARY\\M\\ND\\UNI", "DERIVED\\PRIMARY"}) {
    const auto info = series_of(type);
    EXPECT_TRUE(info.usable) << info.reason;
    EXPECT_TRUE(info.computed) << type;
    EXPECT_THAT(info.warnings, Contains(AllOf(HasSubstr("(0008,0008)"), HasSubstr("of 11 more: computed"),
                                              HasSubstr("where those were resampled or averaged"))));
  }
  for (const char* type : {"ORIGINAL\\PRIMARY\\OTHER\\ND\\NORM\\MEAN", "ORIGINAL\\PRIMARY\\M_SE\\M\\SE",
                           "ORIGINAL\\PRIMARY\\M\\NORM\\DIS2D", "DERIVED\\PRIMARY\\M\\ND\\NORM",
                           "DERIVED\\PRIMARY\\M\\NORM\\DIS3D", "DERIVED\\PRIMARY\\M\\NORM\\DIS2D\\MFSPLIT",
                           "ORIGINAL\\PRIMARY\\W\\W\\DERIVED"}) {
    const auto info = series_of(type);
    EXPECT_TRUE(info.usable) << info.reason;
    EXPECT_FALSE(info.computed) << type;
    EXPECT_THAT(info.warnings, only_of_its_pixels) << type;
  }
}

TEST_F(IntakeTest, PartsOfASignalAreKnownByTheirType) {
  using segmentation::DixonPart;
  const auto series_of = [&](const char* type) {
    GeneratedSeries series;
    series.set_all(DCM_ImageType, type);
    series.write(folder());
    return only_series();
  };
  for (const auto& [type, part] : {std::pair{"ORIGINAL\\PRIMARY\\DIXON\\WATER", DixonPart::water},
                                   {"ORIGINAL\\PRIMARY\\W\\W\\DERIVED", DixonPart::water},
                                   {"DERIVED\\PRIMARY\\DIXON\\IN_PHASE", DixonPart::in_phase},
                                   {"ORIGINAL\\PRIMARY\\M_SE\\M\\SE", DixonPart::all}}) {
    EXPECT_EQ(series_of(type).dixon_part, part) << type;
    EXPECT_THAT(series_of(type).warnings, Not(Contains(HasSubstr("--series"))));
  }
  for (const auto& [type, part] : {std::pair{"ORIGINAL\\PRIMARY\\F\\F\\DERIVED", DixonPart::fat},
                                   {"ORIGINAL\\PRIMARY\\DIXON\\FAT", DixonPart::fat},
                                   {"ORIGINAL\\PRIMARY\\OP\\OP", DixonPart::opposed_phase},
                                   {"ORIGINAL\\PRIMARY\\DIXON\\OUT_PHASE", DixonPart::opposed_phase}}) {
    const auto info = series_of(type);
    EXPECT_TRUE(info.usable) << info.reason;
    EXPECT_EQ(info.dixon_part, part) << type;
    EXPECT_THAT(info.warnings,
                Contains(AllOf(HasSubstr("(0008,0008)"), HasSubstr("only where --series names it"))));
  }
}

/// One slice that was mended does not make an acquisition a computed series, which another one may stand for.
TEST_F(IntakeTest, ASeriesIsComputedWhereAllItsImagesAre) {
  GeneratedSeries series;
  series.set(4, DCM_ImageType, "DERIVED\\SECONDARY\\MPR");
  series.write(folder());
  const auto info = only_series();
  EXPECT_TRUE(info.usable) << info.reason;
  EXPECT_FALSE(info.computed);
  EXPECT_THAT(info.warnings, Contains(HasSubstr("MPR\": computed from other images")));
}

/// In a file of many frames the maps stand beside what they were made from.
TEST_F(IntakeTest, FramesThatAreMapsAreRefusedUnlessOthersAreChosen) {
  const auto file = enhanced_series(true);
  for (int frame = 0; frame < 12; ++frame) {
    DcmItem *groups = nullptr, *type = nullptr;
    file->getDataset()->findAndGetSequenceItem(DCM_PerFrameFunctionalGroupsSequence, groups, frame);
    groups->findOrCreateSequenceItem(DCM_MRImageFrameTypeSequence, type, 0);
    type->putAndInsertString(DCM_FrameType,
                             frame < 6 ? "ORIGINAL\\PRIMARY\\T2\\NONE" : "DERIVED\\PRIMARY\\T2 MAP\\T2");
  }
  ASSERT_TRUE(file->saveFile((folder() / "IM_0001").c_str(), EXS_LittleEndianExplicit).good());
  const auto info = only_series();
  EXPECT_EQ(info.refusal, ExitStatus::unsupported);
  EXPECT_THAT(info.reason, AllOf(HasSubstr("(0008,9007)"), HasSubstr("T2 MAP")));
  auto options = quiet();
  options.choices = {segmentation::parse_series_choice(info.uid + ",FrameType=ORIGINAL\\PRIMARY\\T2\\NONE")};
  const auto chosen = segmentation::read_inventory(folder(), options);
  EXPECT_TRUE(chosen.series.at(0).usable) << chosen.series.at(0).reason;
}

/// Of a header that was changed by hand or by a tool, lengths may be wrong.
TEST_F(IntakeTest, LengthsThatContradictTheFieldOfViewAreWarnedOf) {
  const auto warnings = [&](const char* diameter) {
    GeneratedSeries series;
    series.set_all(DCM_PixelSpacing, "0.5\\0.5");  // 20 rows, 24 columns: 12 mm
    series.set_all(DCM_ReconstructionDiameter, diameter);
    series.write(folder());
    EXPECT_TRUE(only_series().usable);
    return only_series().warnings;
  };
  EXPECT_THAT(warnings("12"), IsEmpty());
  EXPECT_THAT(warnings("12.3"), IsEmpty());  // a rounded one
  EXPECT_THAT(warnings("15"), ElementsAre(AllOf(HasSubstr("(0018,1100)"), HasSubstr("15 mm"),
                                                HasSubstr("12 mm"), HasSubstr("20 %"))));
}

class EnhancedSeries : public IntakeTest, public ::testing::WithParamInterface<bool> {};

TEST_P(EnhancedSeries, IsOneVolume) {
  const auto file = enhanced_series(GetParam());
  ASSERT_TRUE(file->saveFile((folder() / "IM_0001").c_str(), EXS_LittleEndianExplicit).good());
  const auto info = only_series();
  ASSERT_TRUE(info.usable) << info.reason;
  EXPECT_TRUE(info.uniform);
  const auto stack = read_only_series();
  ASSERT_EQ(stack.slices(), 12);
  for (int slice = 0; slice < 12; ++slice) {
    EXPECT_LT((stack.slice_position[slice] - GeneratedSeries::position(slice)).norm(), 1e-6);
    EXPECT_EQ(stack.at(5, 6, slice), (slice + 1) * GeneratedSeries::value(5, 6, slice) - 10);
  }
}
INSTANTIATE_TEST_SUITE_P(TableA, EnhancedSeries, ::testing::Bool(),
                         [](const auto& row) { return row.param ? "SharedGroups" : "PerFrameGroups"; });

/// A concatenation of which a part did not arrive.
TEST_F(IntakeTest, AFileOfAnImageInSeveralThatIsNotHereIsSaid) {
  const auto warnings = [&](Uint16 part, Uint16 parts) {
    const auto file = enhanced_series(true);
    file->getDataset()->putAndInsertString(DCM_ConcatenationUID, "1.2.826.0.1.3680043.9.7.9");
    file->getDataset()->putAndInsertUint16(DCM_InConcatenationNumber, part);
    if (parts > 0) file->getDataset()->putAndInsertUint16(DCM_InConcatenationTotalNumber, parts);
    EXPECT_TRUE(file->saveFile((folder() / "IM_0001").c_str(), EXS_LittleEndianExplicit).good());
    EXPECT_TRUE(only_series().usable);
    return only_series().warnings;
  };
  EXPECT_THAT(warnings(1, 1), Not(Contains(HasSubstr("(0020,9162)"))));
  EXPECT_THAT(warnings(1, 2), Contains(HasSubstr("1 of the 2 files")));
  EXPECT_THAT(warnings(3, 0), Contains(HasSubstr("1 of the 3 files")));
}

TEST_F(IntakeTest, SeveralVolumesInOneEnhancedFileAreRefusedUnlessOneIsChosen) {
  const auto file = enhanced_series(true);
  for (int frame = 0; frame < 12; ++frame) {
    DcmItem* groups = nullptr;
    file->getDataset()->findAndGetSequenceItem(DCM_PerFrameFunctionalGroupsSequence, groups, frame);
    DcmItem *plane = nullptr, *content = nullptr;
    groups->findAndGetSequenceItem(DCM_PlanePositionSequence, plane, 0);
    const int slice = frame / 2;
    const auto place = GeneratedSeries::position(slice);
    plane->putAndInsertString(
        DCM_ImagePositionPatient,
        (std::to_string(place.x()) + "\\" + std::to_string(place.y()) + "\\" + std::to_string(place.z()))
            .c_str());
    groups->findOrCreateSequenceItem(DCM_FrameContentSequence, content, 0);
    content->putAndInsertUint32(DCM_TemporalPositionIndex, 1 + frame % 2);
  }
  ASSERT_TRUE(file->saveFile((folder() / "IM_0001").c_str(), EXS_LittleEndianExplicit).good());
  EXPECT_THAT(only_series().reason, AllOf(HasSubstr("(0020,9128)"), HasSubstr("IM_0001 frame")));
  auto options = quiet();
  options.choices = {segmentation::parse_series_choice("1.2.826.0.1.3680043.9.7.2,TemporalPositionIndex=2")};
  const auto chosen = segmentation::read_inventory(folder(), options);
  ASSERT_TRUE(chosen.series.at(0).usable) << chosen.series.at(0).reason;
  EXPECT_EQ(segmentation::read_series(chosen, chosen.series[0].uid, options).slices(), 6);
}

TEST_F(IntakeTest, FramesWithoutGroupsAreRefused) {
  const auto file = enhanced_series(true);
  file->getDataset()->putAndInsertString(DCM_NumberOfFrames, "13");
  ASSERT_TRUE(file->saveFile((folder() / "IM_0001").c_str(), EXS_LittleEndianExplicit).good());
  EXPECT_THAT(only_series().reason, HasSubstr("(0028,0008)"));
}

TEST_F(IntakeTest, DescriptionsAreConvertedToUtf8) {
  GeneratedSeries series;
  series.set_all(DCM_SpecificCharacterSet, "ISO_IR 100");
  series.set_all(DCM_SeriesDescription,
                 "Sch\xE4"
                 "del T2");
  series.write(folder());
  EXPECT_EQ(only_series().description,
            "Sch\xC3\xA4"
            "del T2");
}

TEST_F(IntakeTest, DescriptionsInNoCharacterSetAreLeftOutAndWarnedOf) {
  GeneratedSeries series;
  series.set_all(DCM_SpecificCharacterSet, "ISO_IR 192");
  series.set_all(DCM_SeriesDescription, "T2 \xFF\xFE <b>%n");
  series.write(folder());
  const auto info = only_series();
  EXPECT_TRUE(info.usable);
  EXPECT_EQ(info.description, "");
  EXPECT_THAT(info.warnings, Contains(AllOf(HasSubstr("(0008,103e)"), HasSubstr("it is left out"))));
}

TEST_F(IntakeTest, AnyModalityOverridesTheKind) {
  GeneratedSeries series;
  series.set_all(DCM_Modality, "CT");
  series.write(folder());
  auto options = quiet();
  options.any_modality = true;
  EXPECT_TRUE(segmentation::read_inventory(folder(), options).series.at(0).usable);
}

TEST_F(IntakeTest, NamesAndOrderOfFilesDoNotMatter) {
  GeneratedSeries series;
  series.remove(4);
  auto files = series.write(folder());
  const auto before = read_only_series();
  for (std::size_t i = 0; i < files.size(); ++i)
    std::filesystem::rename(files[i], files[i].parent_path() / ("z" + std::to_string(97 - i)));
  const auto after = read_only_series();
  EXPECT_EQ(before.slice_intensity, after.slice_intensity);
  EXPECT_EQ(before.slice_position, after.slice_position);
}

}  // namespace
}  // namespace emmetrope::test
