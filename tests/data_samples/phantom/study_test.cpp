// Studies on disk: valid DICOM, what was rendered, whole or not at all.
#include "data_samples/phantom/study.hpp"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>

#include "data_samples/phantom/phantom.hpp"
#include "data_samples/phantom/slice_sampler.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"

namespace emmetrope::phantom {
namespace {

namespace fs = std::filesystem;

class Study : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              ("phantom_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  static StudyRequest small_request(Compression compression = Compression::none) {
    StudyRequest request;
    request.head = sample_head();
    const Anatomy anatomy(request.head);
    request.protocol.name = "custom";
    request.protocol.stacks = {
        make_stack("od-coronal:matrix=48x40,pixel_mm=0.8,slices=3", anatomy),
        make_stack("os-sagittal:matrix=40x40,pixel_mm=0.8,slices=2,contrast=t1", anatomy)};
    request.compression = compression;
    return request;
  }
  static Json write(const fs::path& out, const StudyRequest& request, bool replace = false) {
    return write_study(out, request, replace, 2, Verbosity{true});
  }

  fs::path folder_;
};

TEST_F(Study, TellsHowSlicesWereAcquired) {
  StudyRequest request = small_request();
  const Anatomy anatomy(request.head);
  for (const std::string profile : {"box", "trapezoid", "gaussian", "encoded"}) {
    request.protocol.stacks = {
        make_stack("od-coronal:matrix=16x16,pixel_mm=2,slices=2,profile=" + profile, anatomy)};
    const Json truth = write(folder_ / profile, request);
    EXPECT_EQ(truth["acquisition"]["stacks"][0]["profile"], profile);
  }
}

TEST_F(Study, FatCanBeSuppressed) {
  StudyRequest request = small_request();
  const Anatomy anatomy(request.head);
  const auto brightest = [&](const std::string& fat_left) {
    request.protocol.disturbances.snr = 0;
    request.protocol.stacks = {
        make_stack("head-axial:matrix=64x64,pixel_mm=1,slices=1,contrast=t1,fat_left=" + fat_left, anatomy)};
    const std::vector<float> slice = render(anatomy, request.protocol, 0, 2).slices.front();
    return *std::max_element(slice.begin(), slice.end());
  };
  EXPECT_GT(brightest("1"), reference_intensity);
  EXPECT_LT(brightest("0.1"), 0.8 * reference_intensity);  // white matter and skin have up to 0.58 of fat's
  const Json stack = write(folder_ / "fs", request)["acquisition"]["stacks"][0];
  EXPECT_EQ(stack["fat_left"], 0.1);
  DcmFileFormat file;
  ASSERT_TRUE(
      file.loadFile((folder_ / "fs" / stack["folder"].get<std::string>() / "0001.dcm").c_str()).good());
  OFString options;
  file.getDataset()->findAndGetOFString(DCM_ScanOptions, options);
  EXPECT_EQ(options, "FS");
}

TEST(MakeStack, EncodedSlicesHaveNoGaps) {
  const Anatomy anatomy(sample_head());
  EXPECT_NO_THROW(make_stack("head-axial:slice_mm=1,profile=encoded", anatomy));
  EXPECT_THROW(make_stack("head-axial:slice_mm=2,gap_mm=-1,profile=encoded", anatomy), Error);
}

std::vector<fs::path> images_below(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.path().extension() == ".dcm") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<Uint16> pixels_of(const fs::path& file) {
  DcmFileFormat dicom;
  EXPECT_TRUE(dicom.loadFile(file.c_str()).good()) << file;
  EXPECT_TRUE(dicom.getDataset()->chooseRepresentation(EXS_LittleEndianExplicit, nullptr).good()) << file;
  const Uint16* data = nullptr;
  unsigned long count = 0;
  EXPECT_TRUE(dicom.getDataset()->findAndGetUint16Array(DCM_PixelData, data, &count).good()) << file;
  return {data, data + count};
}

TEST_F(Study, ImagesAreWhatWasRendered) {
  const StudyRequest request = small_request();
  const Json truth = write(folder_ / "study", request);
  EXPECT_EQ(read_json(folder_ / "study/truth.json"), truth);
  const Anatomy anatomy(request.head);
  for (std::size_t i = 0; i < 2; ++i) {
    const RenderedStack stack = render(anatomy, request.protocol, i);
    const Json& entry = truth["acquisition"]["stacks"][i];
    const auto files = images_below(folder_ / "study" / entry["folder"].get<std::string>());
    ASSERT_EQ(files.size(), stack.slices.size());
    for (std::size_t slice = 0; slice < files.size(); ++slice) {
      const auto pixels = pixels_of(files[slice]);
      ASSERT_EQ(pixels.size(), stack.slices[slice].size());
      for (std::size_t k = 0; k < pixels.size(); ++k)
        ASSERT_NEAR(pixels[k], std::min(stack.slices[slice][k], 4095.0F), 0.501);
      DcmFileFormat dicom;
      ASSERT_TRUE(dicom.loadFile(files[slice].c_str()).good());
      DcmDataset& data = *dicom.getDataset();
      for (unsigned long axis = 0; axis < 3; ++axis) {
        double value = 0;
        ASSERT_TRUE(data.findAndGetFloat64(DCM_ImagePositionPatient, value, axis).good());
        EXPECT_NEAR(value, stack.plan.slice_position(static_cast<int>(slice))[static_cast<long>(axis)], 1e-8);
        ASSERT_TRUE(data.findAndGetFloat64(DCM_ImageOrientationPatient, value, axis + 3).good());
        EXPECT_NEAR(value, stack.plan.along_column[static_cast<long>(axis)], 1e-9);
      }
      OFString text;
      data.findAndGetOFString(DCM_SeriesInstanceUID, text);
      EXPECT_EQ(entry["series_uid"], text.c_str());
      data.findAndGetOFString(DCM_PatientName, text);
      EXPECT_EQ(text, "PHANTOM^SYNTHETIC");
      data.findAndGetOFString(DCM_PatientAge, text);
      EXPECT_EQ(text, "040Y");
    }
  }
}

TEST_F(Study, CompressionLosesNothing) {
  DJDecoderRegistration::registerCodecs();
  DJLSDecoderRegistration::registerCodecs();
  write(folder_ / "plain", small_request());
  write(folder_ / "jpeg", small_request(Compression::jpeg_lossless));
  write(folder_ / "jpeg_ls", small_request(Compression::jpeg_ls));
  const auto plain = images_below(folder_ / "plain");
  const auto jpeg = images_below(folder_ / "jpeg");
  const auto jpeg_ls = images_below(folder_ / "jpeg_ls");
  ASSERT_EQ(plain.size(), 5U);
  ASSERT_EQ(jpeg.size(), 5U);
  ASSERT_EQ(jpeg_ls.size(), 5U);
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_EQ(pixels_of(plain[i]), pixels_of(jpeg[i]));
    EXPECT_EQ(pixels_of(plain[i]), pixels_of(jpeg_ls[i]));
    EXPECT_LT(fs::file_size(jpeg_ls[i]), fs::file_size(plain[i]));
  }
  DJDecoderRegistration::cleanup();
  DJLSDecoderRegistration::cleanup();
}

TEST_F(Study, SameRequestSameBytes) {
  write(folder_ / "one", small_request());
  write(folder_ / "two", small_request());
  const auto one = images_below(folder_ / "one");
  const auto two = images_below(folder_ / "two");
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(sha256_of_file(one[i]), sha256_of_file(two[i]));
  EXPECT_EQ(sha256_of_file(folder_ / "one/truth.json"), sha256_of_file(folder_ / "two/truth.json"));
}

TEST_F(Study, IdentifiersAreValidAndUnique) {
  const StudyIdentity identity{"parameters", 40};
  std::set<std::string> seen;
  for (int i = 0; i < 200; ++i) {
    const std::string uid = identity.uid(std::to_string(i));
    EXPECT_LE(uid.size(), 64U);
    EXPECT_EQ(uid.find_first_not_of("0123456789."), std::string::npos);
    EXPECT_EQ(uid.substr(0, 5), "2.25.");
    EXPECT_NE(uid[5], '0');
    EXPECT_TRUE(seen.insert(uid).second);
  }
  EXPECT_EQ(identity.uid("study"), (StudyIdentity{"parameters", 50}).uid("study"));
  EXPECT_NE(identity.uid("study"), (StudyIdentity{"others", 40}).uid("study"));
}

TEST_F(Study, PassesDciodvfy) {
  if (std::system("command -v dciodvfy > /dev/null 2>&1") != 0)
    GTEST_SKIP() << "dciodvfy (dicom3tools) is not installed";
  for (const Compression compression :
       {Compression::none, Compression::jpeg_ls, Compression::jpeg_lossless}) {
    write(folder_ / "study", small_request(compression), true);
    for (const fs::path& file : images_below(folder_ / "study")) {
      const fs::path report = folder_ / "report.txt";
      ASSERT_EQ(std::system(("dciodvfy '" + file.string() + "' > '" + report.string() + "' 2>&1").c_str()), 0)
          << file;
      const std::string text = read_file(report);
      EXPECT_EQ(text.find("Error"), std::string::npos) << text;
      EXPECT_EQ(text.find("Warning"), std::string::npos) << text;
    }
  }
}

TEST_F(Study, ReplacesOnlyPhantomsAndOnlyWhenAsked) {
  const auto status_of = [&](const fs::path& out, bool replace) {
    try {
      write(out, small_request(), replace);
    } catch (const Error& error) {
      return error.status();
    }
    return ExitStatus::done;
  };
  EXPECT_EQ(status_of(folder_ / "study", false), ExitStatus::done);
  EXPECT_EQ(status_of(folder_ / "study", false), ExitStatus::not_writable);
  std::ofstream(folder_ / "study/notes.txt") << "about it";
  EXPECT_EQ(status_of(folder_ / "study", true), ExitStatus::done);
  EXPECT_TRUE(fs::exists(folder_ / "study/notes.txt"));
  EXPECT_TRUE(fs::exists(folder_ / "study/dicom"));
  EXPECT_EQ(status_of(folder_ / "study2/", false), ExitStatus::done);
  EXPECT_EQ(status_of(folder_ / "study2/", true), ExitStatus::done);
  EXPECT_TRUE(fs::exists(folder_ / "study2/truth.json"));
  fs::create_directories(folder_ / "mine");
  std::ofstream(folder_ / "mine/thesis.txt") << "years of work";
  EXPECT_EQ(status_of(folder_ / "mine", true), ExitStatus::not_writable);
  EXPECT_TRUE(fs::exists(folder_ / "mine/thesis.txt"));
  EXPECT_EQ(status_of("/proc/phantom", false), ExitStatus::not_writable);
}

int run_phantom(const std::string& arguments) {
  const char* bin = std::getenv("EMMETROPE_BIN");
  const std::string command = std::string(bin != nullptr ? bin : ".") + "/emmetrope-phantom " + arguments;
  const int status = std::system((command + " > /dev/null 2>&1").c_str());
  return WEXITSTATUS(status);
}

TEST_F(Study, CommandLine) {
  const std::string out = " -o '" + (folder_ / "study").string() + "' ";
  const std::string tiny = " --stack od-coronal:matrix=24x24,pixel_mm=1.2,slices=1 ";
  EXPECT_EQ(run_phantom("--help"), 0);
  EXPECT_EQ(run_phantom(""), 2);
  EXPECT_EQ(run_phantom(out + "--protocol whole-body"), 2);
  EXPECT_EQ(run_phantom(out + "--od axial_length=24"), 2);
  EXPECT_EQ(run_phantom(out + "--od axial_length_mm=12"), 2);
  EXPECT_FALSE(fs::exists(folder_ / "study"));
  EXPECT_EQ(
      run_phantom(out + tiny + "--od axial_length_mm=25,globe_semi_z_mm=11.5 --gaze 4,-20 --head-roll 5"), 0);
  const Json truth = read_json(folder_ / "study/truth.json");
  EXPECT_EQ(truth["eyes"]["od"]["axial_length_mm"], 25.0);
  EXPECT_EQ(truth["head_roll_deg"], 5.0);
  EXPECT_EQ(truth["head"]["os"]["gaze_vertical_deg"], -20.0);
  EXPECT_EQ(run_phantom(out + tiny), 5);
  // truth.json makes the same head again.
  EXPECT_EQ(run_phantom("-o '" + (folder_ / "again").string() + "'" + tiny + "--geometry '" +
                        (folder_ / "study/truth.json").string() + "'"),
            0);
  EXPECT_EQ(read_json(folder_ / "again/truth.json")["eyes"], truth["eyes"]);
}

}  // namespace
}  // namespace emmetrope::phantom
