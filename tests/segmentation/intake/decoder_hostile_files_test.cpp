// Damaged and hostile files: they end the decoding process at worst, within its limits, and the file is
// named.
#include <chrono>
#include <cstring>
#include <fstream>
#include <random>

#include "pipeline/base/files.hpp"
#include "pipeline/base/sanitizers.hpp"
#include "tests/segmentation/intake/intake_test.hpp"

namespace emmetrope::test {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;

void overwrite(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

/// Position of the last occurrence of some bytes.
std::size_t last_of(const std::string& bytes, const std::string& wanted) {
  const auto found = bytes.rfind(wanted);
  if (found == std::string::npos) throw std::runtime_error("bytes not found");
  return found;
}

TEST_F(IntakeTest, ACutFileRefusesItsSeries) {
  GeneratedSeries series;
  const auto files = series.write(folder());
  const std::string whole = read_file(files[5]);
  const std::size_t pixels = last_of(whole, std::string("\xE0\x7F\x10\x00", 4));
  // within the meta header, the data set before and after the series is known, the pixels, and one byte short
  for (const std::size_t size :
       {std::size_t{150}, std::size_t{500}, pixels - 40, pixels + 200, whole.size() - 1}) {
    overwrite(files[5], whole.substr(0, size));
    const auto found = inventory();
    ASSERT_EQ(found.series.size(), 1U) << size;
    EXPECT_FALSE(found.series[0].usable) << size;
    EXPECT_THAT(found.series[0].reason, HasSubstr(file_name(5))) << size;
    EXPECT_EQ(found.status(), ExitStatus::input_invalid);
  }
}

TEST_F(IntakeTest, DeepNestingIsRefused) {
  GeneratedSeries series;
  const auto files = series.write(folder());
  const std::string open("\xE1\x7F\x10\x10SQ\0\0\xFF\xFF\xFF\xFF\xFE\xFF\x00\xE0\xFF\xFF\xFF\xFF", 20);
  const std::string close("\xFE\xFF\x0D\xE0\0\0\0\0\xFE\xFF\xDD\xE0\0\0\0\0", 16);
  for (const int levels : {100, 2'000, 50'000}) {
    GeneratedSeries fresh;
    fresh.write(folder());
    std::string bytes = read_file(files[2]);
    for (int i = 0; i < levels; ++i) bytes += open;
    for (int i = 0; i < levels; ++i) bytes += close;
    overwrite(files[2], bytes);
    const auto info = only_series();
    EXPECT_FALSE(info.usable) << levels;
    EXPECT_THAT(info.reason,
                AllOf(HasSubstr(file_name(2)), AnyOf(HasSubstr("nested"), HasSubstr("crashed the decoder"),
                                                     HasSubstr("ended the decoder"))))  // under a sanitizer
        << levels;
  }
}

TEST_F(IntakeTest, OddLengthsAreRefused) {
  GeneratedSeries series;
  const auto files = series.write(folder());
  std::string bytes = read_file(files[2]);
  const std::size_t at = last_of(bytes, std::string("\x18\x00\x81\x00"
                                                    "DS\x02\x00"
                                                    "91",
                                                    10));
  bytes.replace(at, 10,
                std::string("\x18\x00\x81\x00"
                            "DS\x03\x00"
                            "91 ",
                            11));
  overwrite(files[2], bytes);
  const auto info = only_series();
  EXPECT_FALSE(info.usable);
  EXPECT_THAT(info.reason, HasSubstr(file_name(2)));
}

TEST_F(IntakeTest, AHangingDecoderIsEnded) {
  GeneratedSeries series;
  const auto files = series.write(folder(), EXS_JPEGProcess14SV1);
  // Marker FF01 (TEM) before the frame header sends DCMTK's scan for the bit depth into an endless loop.
  std::string bytes = read_file(files[4]);
  const std::size_t start = last_of(bytes, "\xFF\xD8");
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data() + start - 4, 4);
  length += 2;
  std::memcpy(bytes.data() + start - 4, &length, 4);
  bytes.insert(start + 2, "\xFF\x01");
  overwrite(files[4], bytes);
  auto options = quiet();
  options.limits.cpu_s = 1;
  const auto begin = std::chrono::steady_clock::now();
  const auto found = segmentation::read_inventory(folder(), options);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  EXPECT_FALSE(found.series.at(0).usable);
  EXPECT_THAT(found.series[0].reason,
              AllOf(HasSubstr(file_name(4)), HasSubstr("(7fe0,0010)"), HasSubstr("processor time")));
}

TEST_F(IntakeTest, ADeflatedFileMayNotFillTheMemory) {
#ifdef EMMETROPE_UNDER_SANITIZER
  GTEST_SKIP() << "under a sanitizer the decoder's memory is not limited";
#endif
  GeneratedSeries series;
  series.set(4, DCM_Rows, "6400");
  series.set(4, DCM_Columns, "6400");
  series.set_pixels(4, std::vector<Uint16>(std::size_t{6400} * 6400));  // 82 MB of zeros, 80 KB when deflated
  series.write(folder(), EXS_DeflatedLittleEndianExplicit);
  auto options = quiet();
  options.limits.child_memory_bytes = 100'000'000;
  const auto found = segmentation::read_inventory(folder(), options);
  EXPECT_FALSE(found.series.at(0).usable);
  EXPECT_THAT(found.series[0].reason, AllOf(HasSubstr(file_name(4)), HasSubstr("emory")));
}

TEST_F(IntakeTest, TheWallClockIsLimitedAndHangsAreCounted) {
  GeneratedSeries series;
  series.write(folder());
  auto options = quiet();
  options.limits.wall_s = -1;  // over before it began
  const auto found = segmentation::read_inventory(folder(), options);
  EXPECT_FALSE(found.any_usable());
  int hung = 0, not_read = 0;
  for (const auto& file : found.skipped) {
    hung += file.reason.find("took longer") != std::string::npos ? 1 : 0;
    not_read += file.reason.find("not read") != std::string::npos ? 1 : 0;
  }
  EXPECT_EQ(hung, 3);
  EXPECT_EQ(not_read, 9);
}

struct Compressed {
  const char* name;
  E_TransferSyntax syntax;
};
class CompressedStreams : public IntakeTest, public ::testing::WithParamInterface<Compressed> {
 protected:
  std::vector<std::filesystem::path> write_study() {
    GeneratedSeries series;
    if (is_jpeg2000(GetParam().syntax))
      for (int slice = 0; slice < series.size(); ++slice)
        compress_jpeg2000(series.file(slice),
                          encode_jpeg2000(GeneratedSeries::pixels(slice), GeneratedSeries::rows,
                                          GeneratedSeries::columns, 12),
                          GetParam().syntax);
    return series.write(folder(), GetParam().syntax);
  }
};

/// Bytes of the stream zeroed, the rest of the file sound: decoders like to fill in zeros silently.
TEST_P(CompressedStreams, AreRefusedWhenDamaged) {
  const auto files = write_study();
  std::string bytes = read_file(files[6]);
  const std::size_t end = last_of(bytes, std::string("\xFE\xFF\xDD\xE0", 4));
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(end - 120),
            bytes.begin() + static_cast<std::ptrdiff_t>(end), '\0');
  overwrite(files[6], bytes);
  const auto info = only_series();
  EXPECT_FALSE(info.usable);
  EXPECT_THAT(info.reason, AllOf(HasSubstr(file_name(6)), HasSubstr("(7fe0,0010)")));
}

TEST_P(CompressedStreams, AreRefusedWhenTheirSizeIsNotTheImages) {
  const auto files = write_study();
  for (const auto& file : files) {
    DcmFileFormat parsed;
    ASSERT_TRUE(parsed.loadFile(file.c_str()).good());
    parsed.loadAllDataIntoMemory();
    parsed.getDataset()->putAndInsertUint16(DCM_Rows, 40);
    ASSERT_TRUE(parsed.saveFile(file.c_str(), GetParam().syntax).good());
  }
  EXPECT_FALSE(only_series().usable);
  EXPECT_THAT(only_series().reason, HasSubstr("(7fe0,0010)"));
}

TEST_P(CompressedStreams, MayNotUnpackToMoreThanTheLimit) {
  write_study();
  auto options = quiet();
  options.limits.file_bytes = 500;
  EXPECT_THAT(segmentation::read_inventory(folder(), options).series.at(0).reason, HasSubstr("(0028,0010)"));
}

INSTANTIATE_TEST_SUITE_P(TableA, CompressedStreams,
                         ::testing::Values(Compressed{"JpegLossless", EXS_JPEGProcess14SV1},
                                           Compressed{"JpegLs", EXS_JPEGLSLossless},
                                           Compressed{"Rle", EXS_RLELossless},
                                           Compressed{"Jpeg2000", EXS_JPEG2000LosslessOnly}),
                         [](const auto& row) { return std::string(row.param.name); });

TEST_F(IntakeTest, UnknownTransferSyntaxesAreUnsupported) {
  GeneratedSeries series;
  series.write(folder(), EXS_JPEGLSLossless);
  for (const auto& entry : std::filesystem::directory_iterator(folder() / "scan")) {
    std::string bytes = read_file(entry.path());
    bytes.replace(last_of(bytes.substr(0, 400), "1.2.840.10008.1.2.4.80"), 23,
                  std::string("1.2.840.10008.1.2.4.102", 23));
    overwrite(entry.path(), bytes);
  }
  const auto found = inventory();
  EXPECT_EQ(found.status(), ExitStatus::unsupported);
  EXPECT_THAT(found.series.at(0).reason, HasSubstr("(0002,0010)"));
}

/// Random changes of valid files: whatever happens in the decoding process, the study is judged.
TEST_F(IntakeTest, RandomDamageNeverEndsTheProgram) {
  std::mt19937 random(20240607);
  for (const auto syntax :
       {EXS_LittleEndianExplicit, EXS_RLELossless, EXS_JPEGLSLossless, EXS_JPEGProcess14SV1}) {
    GeneratedSeries series;
    const auto files = series.write(folder(), syntax);
    for (const auto& file : files) {
      std::string bytes = read_file(file);
      for (int change = 0; change < 6; ++change)
        bytes[140 + random() % (bytes.size() - 140)] = static_cast<char>(random());
      if (random() % 4 == 0) bytes.resize(200 + random() % (bytes.size() - 200));
      overwrite(file, bytes);
    }
    auto options = quiet();
    options.limits.cpu_s = 1;
    const auto found = segmentation::read_inventory(folder(), options);
    EXPECT_NO_THROW(to_json(found).dump(-1, ' ', false, Json::error_handler_t::replace));
    std::size_t seen = found.skipped.size();
    for (const auto& info : found.series) seen += info.files;
    EXPECT_GE(seen, files.size());
  }
}

}  // namespace
}  // namespace emmetrope::test
