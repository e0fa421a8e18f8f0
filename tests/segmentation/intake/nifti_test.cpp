#include <cstring>
#include <fstream>
#include <limits>
#include <random>

#include "pipeline/base/files.hpp"
#include "pipeline/base/sanitizers.hpp"
#include "segmentation/intake/decoder.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/intake/slice_grid.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using segmentation::Stack;
using ::testing::AllOf;
using ::testing::HasSubstr;

/// An oblique stack, its slices at these numbers times 2 mm.
Stack oblique_stack(const std::vector<double>& slice_numbers) {
  Stack stack;
  stack.name = "stack1";
  stack.columns = 7;
  stack.rows = 5;
  stack.along_row = GeneratedSeries::along_row();
  stack.along_column = GeneratedSeries::along_column();
  stack.normal = GeneratedSeries::normal();
  stack.column_spacing_mm = 0.4;
  stack.row_spacing_mm = 0.5;
  stack.slice_thickness_mm = 2;
  for (const double number : slice_numbers) {
    stack.slice_position.push_back(GeneratedSeries::position(number));
    std::vector<float> values;
    for (int i = 0; i < 35; ++i) values.push_back(static_cast<float>(10 * number + i) + 0.25F);
    stack.slice_intensity.push_back(values);
  }
  return stack;
}

void expect_same(const Stack& a, const Stack& b, double tolerance_mm) {
  ASSERT_EQ(a.slices(), b.slices());
  EXPECT_EQ(a.slice_intensity, b.slice_intensity);
  for (int slice = 0; slice < a.slices(); ++slice)
    for (const auto& [column, row] : {std::pair{0, 0}, std::pair{6, 4}})
      EXPECT_LT((a.position(column, row, slice) - b.position(column, row, slice)).norm(), tolerance_mm);
}

template <typename T>
void patch(const std::filesystem::path& file, std::size_t offset, T value) {
  std::string bytes = read_file(file);
  std::memcpy(bytes.data() + offset, &value, sizeof value);
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

class NiftiTest : public ::testing::Test {
 protected:
  std::filesystem::path file(const std::string& name) const { return folder_.path() / name; }
  /// A sound, not compressed file to be broken.
  std::filesystem::path sound() const {
    segmentation::write_nifti(file("sound.nii"), oblique_stack({0, 1, 2, 3}));
    return file("sound.nii");
  }

 private:
  TemporaryFolder folder_;
};

TEST_F(NiftiTest, KeepsVoxelsAndPlaces) {
  for (const auto* name : {"a.nii", "a.nii.gz"}) {
    const Stack stack = oblique_stack({0, 1, 2, 3});
    segmentation::write_nifti(file(name), stack);
    expect_same(segmentation::read_nifti(file(name)), stack, 2e-5);  // float32 of 100 mm
  }
}

TEST_F(NiftiTest, KeepsGaps) {
  const Stack stack = oblique_stack({0, 1, 3, 4, 7});
  segmentation::write_nifti(file("a.nii.gz"), stack);
  expect_same(segmentation::read_nifti(file("a.nii.gz")), stack, 2e-5);
}

TEST_F(NiftiTest, SaysHowFarUnevenSlicesAreFromTheGrid) {
  const Stack stack = oblique_stack({0, 1, 2.1, 3, 4});
  segmentation::write_nifti(file("a.nii"), stack);
  const Json sidecar = read_json(file("a.json"));
  const auto grid = segmentation::fit_slice_grid(stack);
  EXPECT_DOUBLE_EQ(sidecar.at("largest_distance_from_grid_mm").get<double>(), grid.deviation_mm);
  EXPECT_NEAR(grid.deviation_mm, 0.16, 1e-3);  // 0.2 mm less the mean of five, 0.04
  EXPECT_NEAR(sidecar.at("slices").at(2).at("position_lps_mm").at(0).get<double>(),
              stack.slice_position[2].x(), 1e-12);
}

TEST_F(NiftiTest, QuaternionAndMatrixSayTheSame) {
  const auto path = sound();
  patch<std::int16_t>(path, 254, 0);  // no sform: the qform decides
  expect_same(segmentation::read_nifti(path), oblique_stack({0, 1, 2, 3}), 1e-4);
}

/// nifti2.h: what lies where.
std::string as_nifti2(const std::string& first) {
  std::string second(544, '\0');
  const auto put = [&](std::size_t offset, auto value) {
    std::memcpy(second.data() + offset, &value, sizeof value);
  };
  const auto get = [&](std::size_t offset, auto value) {
    std::memcpy(&value, first.data() + offset, sizeof value);
    return value;
  };
  put(0, std::int32_t{540});
  std::memcpy(second.data() + 4, "n+2\0\r\n\032\n", 8);
  put(12, get(70, std::int16_t{}));
  put(14, get(72, std::int16_t{}));
  for (std::size_t i = 0; i < 8; ++i) {
    put(16 + 8 * i, static_cast<std::int64_t>(get(40 + 2 * i, std::int16_t{})));
    put(104 + 8 * i, static_cast<double>(get(76 + 4 * i, 0.F)));
  }
  for (std::size_t i = 0; i < 3; ++i) put(80 + 8 * i, 0.84);  // parameters of an intent, no sides of voxels
  put(168, std::int64_t{544});
  put(176, static_cast<double>(get(112, 0.F)));
  put(184, static_cast<double>(get(116, 0.F)));
  put(344, static_cast<std::int32_t>(get(252, std::int16_t{})));
  put(348, static_cast<std::int32_t>(get(254, std::int16_t{})));
  for (std::size_t i = 0; i < 6; ++i) put(352 + 8 * i, static_cast<double>(get(256 + 4 * i, 0.F)));
  for (std::size_t i = 0; i < 12; ++i) put(400 + 8 * i, static_cast<double>(get(280 + 4 * i, 0.F)));
  put(504, static_cast<std::int32_t>(get(68, std::int16_t{})));
  put(500, static_cast<std::int32_t>(first[123]));
  return second + first.substr(static_cast<std::size_t>(get(108, 0.F)));
}

TEST_F(NiftiTest, OfTheSecondVersionIsTheSame) {
  std::ofstream(file("second.nii"), std::ios::binary) << as_nifti2(read_file(sound()));
  const Stack stack = oblique_stack({0, 1, 2, 3});
  for (const std::int32_t sform_code : {1, 0}) {
    patch<std::int32_t>(file("second.nii"), 348, sform_code);
    std::vector<std::string> warnings;
    expect_same(segmentation::read_nifti(file("second.nii"), warnings), stack, 1e-4);
    EXPECT_THAT(warnings, testing::IsEmpty()) << sform_code;
  }
}

/// An sform that is aligned to another scan may be scaled; the scanner's own form is not.
TEST_F(NiftiTest, TheScannersOwnFormGoesBeforeAnAlignedOne) {
  const auto path = sound();
  patch<std::int16_t>(path, 252, 1);
  patch<std::int16_t>(path, 254, 2);
  std::string bytes = read_file(path);
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column) {
      float value = 0;
      std::memcpy(&value, bytes.data() + 280 + 16 * row + 4 * column, 4);
      patch<float>(path, 280 + 16 * row + 4 * column, 1.05F * value);
    }
  std::vector<std::string> warnings;
  expect_same(segmentation::read_nifti(path, warnings), oblique_stack({0, 1, 2, 3}), 1e-4);
  EXPECT_THAT(warnings, testing::Contains(testing::HasSubstr("aligned to another scan and scaled")));
  patch<std::int16_t>(path, 254, 1);  // both the scanner's: one of them is wrong
  warnings.clear();
  EXPECT_NEAR(segmentation::read_nifti(path, warnings).slice_thickness_mm, 2.1, 1e-5);
  EXPECT_THAT(warnings, testing::Contains(testing::HasSubstr("lengths are wrong by up to 5 %")));
}

TEST_F(NiftiTest, SaysWhereValuesAreLabelsOrStatistics) {
  const auto path = sound();
  for (const auto& [code, is_image] :
       {std::pair<std::int16_t, bool>{0, true}, {1002, false}, {1011, true}, {5, false}, {2001, true}}) {
    patch<std::int16_t>(path, 68, code);
    std::vector<std::string> warnings;
    segmentation::read_nifti(path, warnings);
    EXPECT_EQ(warnings.empty(), is_image) << code;
    std::ofstream(file("second.nii"), std::ios::binary) << as_nifti2(read_file(path));
    warnings.clear();
    segmentation::read_nifti(file("second.nii"), warnings);
    EXPECT_EQ(warnings.empty(), is_image) << code;
  }
}

TEST_F(NiftiTest, IsRasPlus) {
  // The first voxel's LPS (-40, -70, 30) is RAS (40, 70, 30).
  const std::string bytes = read_file(sound());
  float x = 0, y = 0, z = 0;
  std::memcpy(&x, bytes.data() + 292, 4);
  std::memcpy(&y, bytes.data() + 308, 4);
  std::memcpy(&z, bytes.data() + 324, 4);
  EXPECT_FLOAT_EQ(x, 40);
  EXPECT_FLOAT_EQ(y, 70);
  EXPECT_FLOAT_EQ(z, 30);
}

TEST_F(NiftiTest, LabelsLieOnTheSameGrid) {
  const Stack stack = oblique_stack({0, 1, 3});
  std::vector<std::vector<std::uint8_t>> labels(3, std::vector<std::uint8_t>(35, 4));
  segmentation::write_label_nifti(file("labels.nii.gz"), stack, labels);
  const Stack read = segmentation::read_nifti(file("labels.nii.gz"));
  ASSERT_EQ(read.slices(), 4);
  EXPECT_EQ(read.at(3, 3, 1), 4);
  EXPECT_EQ(read.at(3, 3, 2), 0);  // the gap
  EXPECT_EQ(read.at(3, 3, 3), 4);
  EXPECT_LT((read.position(2, 3, 3) - stack.position(2, 3, 2)).norm(), 2e-5);
}

TEST_F(IntakeTest, AVolumeOfOneSliceIsSaid) {
  segmentation::write_nifti(folder() / "a.nii", oblique_stack({0}));
  EXPECT_THAT(only_series().warnings, testing::Contains(HasSubstr("one slice only")));
}

TEST_F(IntakeTest, TwoSlicesAreNoVolume) {
  GeneratedSeries series;
  while (series.size() > 2) series.remove(2);
  series.write(folder());
  EXPECT_THAT(only_series().warnings, testing::Contains(HasSubstr("two slices only")));
}

TEST_F(NiftiTest, EqualStacksGiveEqualBytes) {
  segmentation::write_nifti(file("a.nii.gz"), oblique_stack({0, 1, 3}));
  segmentation::write_nifti(file("b.nii.gz"), oblique_stack({0, 1, 3}));
  EXPECT_EQ(read_file(file("a.nii.gz")), read_file(file("b.nii.gz")));
}

TEST_F(NiftiTest, AppliesItsScale) {
  const auto path = sound();
  patch(path, 112, 2.0F);
  patch(path, 116, -5.0F);
  EXPECT_FLOAT_EQ(segmentation::read_nifti(path).at(3, 2, 1), 2 * oblique_stack({1}).at(3, 2, 0) - 5);
  patch(path, 112, 0.0F);  // a slope of 0 means none
  EXPECT_FLOAT_EQ(segmentation::read_nifti(path).at(3, 2, 1), oblique_stack({1}).at(3, 2, 0));
}

TEST_F(NiftiTest, ALeftHandedVolumeIsTurnedWithItsSlices) {
  const auto path = sound();
  // Third column of the sform reversed, the origin at the other end: the same voxels stored in reverse.
  const Stack stack = oblique_stack({0, 1, 2, 3});
  const Eigen::Vector3d step = GeneratedSeries::position(1) - GeneratedSeries::position(0),
                        last = stack.slice_position[3];
  const Eigen::Vector3d ras(-1, -1, 1);
  for (std::size_t i = 0; i < 3; ++i) {
    patch(path, 280 + 16 * i + 8, static_cast<float>(-ras[static_cast<int>(i)] * step[static_cast<int>(i)]));
    patch(path, 292 + 16 * i, static_cast<float>(ras[static_cast<int>(i)] * last[static_cast<int>(i)]));
  }
  patch<std::int16_t>(path, 252, 0);
  Stack expected = stack;
  std::reverse(expected.slice_intensity.begin(), expected.slice_intensity.end());
  expect_same(segmentation::read_nifti(path), expected, 1e-4);
}

/// Lengths on a template's grid are the person's only where the head was not scaled to it.
TEST_F(NiftiTest, ATemplatesCoordinatesGiveWayToTheScannersOrAreWarnedOf) {
  const auto path = sound();
  std::vector<std::string> warnings;
  patch<std::int16_t>(path, 252, 1);  // the qform: the scanner's
  patch<std::int16_t>(path, 254, 4);  // the sform: MNI's, and the same: the voxels are a template's
  EXPECT_NEAR(segmentation::read_nifti(path, warnings).column_spacing_mm, 0.4, 1e-6);
  EXPECT_THAT(warnings, testing::ElementsAre(HasSubstr("sform_code is 4, a template's coordinates")));
  warnings.clear();
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t at = 280 + 16 * i + 4 * k;
      float value = 0;
      std::memcpy(&value, read_file(path).data() + at, sizeof value);
      patch(path, at, 1.05F * value);
    }
  EXPECT_NEAR(segmentation::read_nifti(path, warnings).column_spacing_mm, 0.4, 1e-6);
  EXPECT_THAT(warnings, testing::ElementsAre(HasSubstr("the qform is used, as the sform is a template's")));
  patch<std::int16_t>(path, 252, 0);
  warnings.clear();
  EXPECT_NEAR(segmentation::read_nifti(path, warnings).column_spacing_mm, 0.42, 1e-6);
  EXPECT_THAT(warnings, testing::ElementsAre(HasSubstr("pixdim is 0.4 x 0.5 x 2 mm"),
                                             HasSubstr("sform_code is 4, a template's coordinates")));
}

/// What was registered to a template often keeps the scanner's codes: then its voxels tell.
TEST_F(NiftiTest, VoxelsOfATemplateAreWarnedOf) {
  const auto warnings_of = [&](double side_mm, double turn_rad) {
    Stack stack;
    stack.columns = 79;
    stack.rows = 95;
    stack.along_row = {-std::cos(turn_rad), std::sin(turn_rad), 0};
    stack.along_column = {-std::sin(turn_rad), -std::cos(turn_rad), 0};
    stack.normal = stack.along_row.cross(stack.along_column);
    stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = side_mm;
    for (int slice = 0; slice < 79; ++slice) {
      stack.slice_position.emplace_back(78, 112, -70 + side_mm * slice);
      stack.slice_intensity.emplace_back(79 * 95, static_cast<float>(slice % 7));
    }
    segmentation::write_nifti(file("grid.nii"), stack);
    std::vector<std::string> warnings;
    segmentation::read_nifti(file("grid.nii"), warnings);
    return warnings;
  };
  EXPECT_THAT(warnings_of(2, 0),
              testing::Contains(HasSubstr("79 x 95 x 79 voxels along the axes are those of the MNI")));
  for (const auto& [side_mm, turn_rad] : {std::pair{2.1, 0.0}, std::pair{2.0, 0.05}})
    EXPECT_THAT(warnings_of(side_mm, turn_rad), testing::Each(testing::Not(HasSubstr("MNI"))));
}

/// Nothing tells which of the two is right: all lengths may be wrong.
TEST_F(NiftiTest, AnSformThatContradictsPixdimIsWarnedOf) {
  const auto path = sound();
  const auto warnings = [&] {
    std::vector<std::string> texts;
    EXPECT_NEAR(segmentation::read_nifti(path, texts).column_spacing_mm, 0.4, 1e-6);
    return texts;
  };
  patch<std::int16_t>(path, 252, 0);  // the sform alone
  EXPECT_THAT(warnings(), testing::IsEmpty());
  patch(path, 80, 0.4F * 1.005F);  // a rounded one
  EXPECT_THAT(warnings(), testing::IsEmpty());
  patch(path, 80, 0.4F / 1.05F);
  EXPECT_THAT(warnings(),
              testing::ElementsAre(AllOf(
                  HasSubstr("pixdim is 0.381 x 0.5 x 2 mm, but voxels of the sform are 0.4 x 0.5 x 2 mm"),
                  HasSubstr("wrong by up to 5 %"))));
  for (const float nothing : {0.0F, std::numeric_limits<float>::quiet_NaN()}) {
    patch(path, 80, nothing);
    EXPECT_THAT(warnings(), testing::IsEmpty());
  }
}

TEST_F(NiftiTest, FormsThatContradictEachOtherAboutLeftAndRightAreRefused) {
  const auto path = sound();
  patch(path, 76, -1.0F);  // qfac
  EXPECT_THROW(segmentation::read_nifti(path), Error);
  patch<std::int16_t>(path, 252, 0);  // the sform alone
  EXPECT_NO_THROW(segmentation::read_nifti(path));
}

TEST_F(NiftiTest, BrokenFilesAreRefusedByName) {
  struct Defect {
    std::size_t offset;
    std::int16_t value;
    const char* says;
  };
  // sizeof_hdr, dim[1], dim[3] too long, four dimensions, datatype RGB, float32 of 8 bits, magic
  for (const auto& [offset, value, says] :
       {Defect{0, 1, "sizeof_hdr"}, Defect{42, 0, "dim[1]"}, Defect{46, 30'000, "voxels"},
        Defect{40, 9, "dim[0]"}, Defect{70, 128, "datatype"}, Defect{72, 8, "bitpix"},
        Defect{344, 0, "magic"},
        // An unknown unit of length; voxels of 400 m and 0.4 um.
        Defect{123, 5, "xyzt_units"}, Defect{123, 1, "xyzt_units"}, Defect{123, 3, "xyzt_units"}}) {
    const auto path = sound();
    patch(path, offset, value);
    try {
      segmentation::read_nifti(path);
      ADD_FAILURE() << says;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(path.string()));
      EXPECT_THAT(error.what(), HasSubstr(says));
    }
  }
}

/// A time series has volumes to choose from; a picture in colours has three values of each voxel.
TEST_F(NiftiTest, MoreThanOneValueOfAVoxelIsRefusedByWhatItIs) {
  for (const auto& [dimension, says] :
       {std::pair{4, "several volumes; give one"}, {5, "several values of each voxel"}}) {
    const auto path = sound();
    patch<std::int16_t>(path, 40, 5);
    for (const int other : {4, 5})
      patch<std::int16_t>(path, 40 + 2 * static_cast<std::size_t>(other), other == dimension ? 3 : 1);
    try {
      segmentation::read_nifti(path);
      ADD_FAILURE() << says;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(says));
    }
  }
}

TEST_F(NiftiTest, ScalesThatNoScanHasAreRefusedByField) {
  for (const auto& [offset, value, says] : {std::tuple{112, -1.0F, "scl_slope"},
                                            {112, 1e30F, "scl_slope"},
                                            {116, 1e12F, "scl_inter"},
                                            {280, 3e38F, "srow_x"},
                                            {280, 0.001F, "srow_x"}}) {
    const auto path = sound();
    patch(path, 112, 1.0F);
    for (const int srow : {296, 312}) patch(path, static_cast<std::size_t>(srow), 0.0F);  // i is x alone
    patch(path, static_cast<std::size_t>(offset), value);
    try {
      segmentation::read_nifti(path);
      ADD_FAILURE() << says;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(says));
    }
  }
}

TEST_F(NiftiTest, MetresAndMicronsAreUnderstood) {
  for (const auto& [unit, of_mm] : {std::pair{char{1}, 1e-3F}, {char{3}, 1e3F}}) {
    const auto path = sound();
    const std::string bytes = read_file(path);
    for (std::size_t at = 280; at < 328; at += 4) {
      float value = 0;
      std::memcpy(&value, bytes.data() + at, 4);
      patch(path, at, value * of_mm);
    }
    patch<std::int16_t>(path, 252, 0);  // the sform alone
    patch(path, 123, unit);
    expect_same(segmentation::read_nifti(path), oblique_stack({0, 1, 2, 3}), 1e-4);
  }
}

/// A gzip stream that unpacks to voxels but not to those that were packed.
TEST_F(NiftiTest, AWrongChecksumIsADamagedStream) {
  segmentation::write_nifti(file("a.nii.gz"), oblique_stack({0, 1, 2}));
  const auto size = std::filesystem::file_size(file("a.nii.gz"));
  patch(file("a.nii.gz"), size - 8, std::int32_t{0});
  try {
    segmentation::read_nifti(file("a.nii.gz"));
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("checksum"));
  }
}

TEST_F(NiftiTest, RefusesWhatCannotBePlacedOrMeasured) {
  auto path = sound();
  patch<std::int16_t>(path, 252, 0);
  patch<std::int16_t>(path, 254, 0);
  EXPECT_THROW(segmentation::read_nifti(path), Error);  // no orientation

  path = sound();
  patch(path, 112, std::numeric_limits<float>::quiet_NaN());
  EXPECT_THROW(segmentation::read_nifti(path), Error);

  path = sound();
  patch(path, 352 + 40, std::numeric_limits<float>::quiet_NaN());
  EXPECT_THROW(segmentation::read_nifti(path), Error);  // one voxel without a value

  path = sound();
  patch(path, 280 + 8, 0.5F);  // the slices run off the normal
  EXPECT_THROW(segmentation::read_nifti(path), Error);

  path = sound();
  patch<std::int16_t>(path, 40, 4);
  patch<std::int16_t>(path, 48, 2);
  EXPECT_THROW(segmentation::read_nifti(path), Error);  // two volumes

  const std::string packed = [&] {
    segmentation::write_nifti(file("a.nii.gz"), oblique_stack({0, 1, 2}));
    return read_file(file("a.nii.gz"));
  }();
  std::ofstream(file("a.nii.gz"), std::ios::trunc) << packed.substr(0, packed.size() / 2);
  EXPECT_THROW(segmentation::read_nifti(file("a.nii.gz")), Error);
}

/// In the decoding process as in this one, geometry, values and warnings to the last bit.
TEST_F(NiftiTest, TheDecoderReadsTheSameVolume) {
  const auto path = sound();
  patch(path, 280 + 12, 100.5F);  // sform and qform disagree
  segmentation::Decoder decoder{segmentation::IntakeLimits{}};
  std::vector<std::string> here;
  const Stack expected = segmentation::read_nifti(path, here);
  const segmentation::Decoder::Volume read = decoder.decode_volume(path);
  expect_same(read.stack, expected, 1e-12);
  EXPECT_EQ(read.stack.normal, expected.normal);
  EXPECT_EQ(read.warnings, here);
  EXPECT_FALSE(here.empty());
}

TEST_F(NiftiTest, TheDecoderRefusesByNameAndGoesOn) {
#ifdef EMMETROPE_UNDER_SANITIZER
  GTEST_SKIP() << "under a sanitizer the decoder's memory is not limited";
#endif
  segmentation::Decoder decoder{segmentation::IntakeLimits{}};
  const auto refusal = [&](const std::filesystem::path& path) -> std::string {
    try {
      decoder.decode_volume(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.what();
    }
    return "read";
  };
  auto path = sound();
  patch<std::int16_t>(path, 252, 0);
  patch<std::int16_t>(path, 254, 0);
  EXPECT_THAT(refusal(path), HasSubstr("sound.nii: sform_code"));
  path = sound();  // a slice of 4 GB in a file of half a kilobyte
  for (const std::size_t dim : {42, 44}) patch<std::int16_t>(path, dim, 31'000);
  patch<std::int16_t>(path, 46, 1);
  EXPECT_THAT(refusal(path), HasSubstr("sound.nii: needs more memory"));
  EXPECT_EQ(refusal(sound()), "read");

  segmentation::IntakeLimits hasty;
  hasty.wall_s = -1;
  segmentation::Decoder late(hasty);
  try {
    late.decode_volume(sound());
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("sound.nii: took longer"));
  }
}

/// Random changes of a valid volume: it is read or refused.
TEST_F(NiftiTest, RandomDamageNeverEndsTheProgram) {
  std::mt19937 random(20240607);
  const std::string whole = read_file(sound());
  segmentation::Decoder decoder{segmentation::IntakeLimits{}};
  for (int round = 0; round < 60; ++round) {
    std::string bytes = whole;
    for (int change = 0; change < 4; ++change) bytes[random() % 352] = static_cast<char>(random());
    std::ofstream(file("damaged.nii"), std::ios::binary | std::ios::trunc) << bytes;
    try {
      const Stack read = decoder.decode_volume(file("damaged.nii")).stack;
      EXPECT_GT(read.slices(), 0);
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("damaged.nii"));
    }
  }
}

TEST_F(NiftiTest, AStudyMayBeNifti) {
  segmentation::write_nifti(file("scan.nii.gz"), oblique_stack({0, 1, 2, 3}));
  const auto found = segmentation::read_inventory(file("scan.nii.gz"), quiet());
  ASSERT_EQ(found.series.size(), 1U);
  EXPECT_TRUE(found.series[0].usable);
  EXPECT_TRUE(found.series[0].uniform);
  expect_same(segmentation::read_series(found, found.series[0].uid, quiet()), oblique_stack({0, 1, 2, 3}),
              2e-5);
}

/// NIfTI does not say whether an acquisition was 3-D.
TEST_F(NiftiTest, ThinSlicesAreTakenForEncodedOnes) {
  for (const double times : {0.8, 1.0}) {
    Stack stack = oblique_stack({0, times, 2 * times, 3 * times});
    stack.slice_thickness_mm *= times;
    segmentation::write_nifti(file("scan.nii.gz"), stack);
    const auto found = segmentation::read_inventory(file("scan.nii.gz"), quiet());
    EXPECT_EQ(segmentation::read_series(found, found.series.at(0).uid, quiet()).slices_are_encoded,
              stack.slice_spacing_mm() < 1.65)
        << stack.slice_spacing_mm();
  }
}

TEST(SliceGrid, FindsGapsAndSpacing) {
  const auto grid = segmentation::fit_slice_grid({0, 2, 4.001, 10, 12});
  EXPECT_EQ(grid.plane, (std::vector<int>{0, 1, 2, 5, 6}));
  EXPECT_NEAR(grid.spacing_mm, 2, 1e-3);
  EXPECT_LT(grid.deviation_mm, 0.002);
  EXPECT_TRUE(grid.has_gaps());
  EXPECT_EQ(grid.planes(), 7);
  EXPECT_EQ(segmentation::fit_slice_grid({5.0}).planes(), 1);
}

}  // namespace
}  // namespace emmetrope::test
