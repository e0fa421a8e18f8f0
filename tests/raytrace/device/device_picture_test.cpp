// Samples added until the picture's standard error is small enough, and float pictures on disk.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/picture/float_files.hpp"
#include "raytrace/tracer/exposure.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

TraceSettings settings_of(int samples) {
  TraceSettings settings;
  settings.grid = {64, 64, 0.8, 0.8, {0, 0}};
  settings.samples = samples;
  settings.wavelength_nm = 555;
  settings.verbosity.quiet = true;
  return settings;
}

double rms_levels(const LinearImage& a, const LinearImage& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) sum += std::pow(double(a.values[i]) - b.values[i], 2);
  return 255 * std::sqrt(sum / static_cast<double>(a.values.size()));
}

class Progressive : public testing::Test {
 protected:
  Tracer tracer_{""};
  EyeModel eye_ = make_eye("gullstrand", {0, {}, 4.0});
  std::shared_ptr<const Scene> scene_ = make_scene("letters:logmar=0.9,distance_mm=1000,extent_deg=4");
};

TEST_F(Progressive, TheErrorItReportsIsThatOfThePicture) {
  const TraceResult reference = tracer_.trace(eye_, *scene_, settings_of(32768));
  int samples_before = 0;
  for (const double target : {4.0, 1.0, 0.3}) {
    TraceSettings settings = settings_of(16384);
    settings.target_error = target;
    const TraceResult result = tracer_.trace(eye_, *scene_, settings);
    ASSERT_TRUE(result.error);
    EXPECT_LE(*result.error, target);
    EXPECT_GT(result.samples, samples_before);
    EXPECT_EQ(result.rays, 64ULL * 64 * result.samples);
    samples_before = result.samples;
    // An error of two halves over 4096 pixels is known to a few per cent; the sequences are no independent
    // samples, so that the mean of both may be better or worse than that of unrelated ones.
    const double error = rms_levels(result.image, reference.image);
    EXPECT_GT(error, 0.5 * *result.error) << target;
    EXPECT_LT(error, 1.6 * *result.error) << target;
  }
}

TEST_F(Progressive, StopsAtTheLimitAndIsRepeatable) {
  TraceSettings settings = settings_of(256);
  settings.target_error = 1e-3;
  const TraceResult result = tracer_.trace(eye_, *scene_, settings);
  EXPECT_EQ(result.samples, 256);
  EXPECT_GT(*result.error, 1e-3);
  EXPECT_EQ(tracer_.trace(eye_, *scene_, settings).image.values, result.image.values);
  settings.target_error = 0;
  EXPECT_THROW(tracer_.trace(eye_, *scene_, settings), Error);
}

TEST_F(Progressive, AMovingEyeReachesItToo) {
  TraceSettings settings = settings_of(16384);
  settings.target_error = 1;
  const TraceResult result = trace_exposure(tracer_, eye_, *scene_, settings, {{0.2, 0}, 8});
  EXPECT_LE(*result.error, 1);
  const TraceResult reference = trace_exposure(tracer_, eye_, *scene_, settings_of(32768), {{0.2, 0}, 8});
  EXPECT_LT(rms_levels(result.image, reference.image), 1.6 * *result.error);
}

TEST_F(Progressive, OpenExrAndTiffHoldTheLinearFloats) {
  const test::TemporaryFolder folder;
  for (const int channels : {1, 3}) {
    LinearImage image{3, 2, channels, {}};
    for (int i = 0; i < 6 * channels; ++i) image.values.push_back(0.1F * static_cast<float>(i * i) + 1e-4F);
    write_exr(folder.path() / "picture.exr", image);
    write_tiff(folder.path() / "picture.tiff", image);
    EXPECT_EQ(read_file(folder.path() / "picture.exr").substr(0, 4), "\x76\x2f\x31\x01");
    for (const char* name : {"picture.exr", "picture.tiff"}) {
      const cv::Mat read = cv::imread((folder.path() / name).string(), cv::IMREAD_UNCHANGED);
      ASSERT_EQ(read.type(), CV_32FC(channels)) << name;
      ASSERT_EQ(read.size(), cv::Size(3, 2)) << name;
      for (int row = 0; row < 2; ++row)
        for (int column = 0; column < 3; ++column)
          for (int c = 0; c < channels; ++c)  // OpenCV: blue first
            EXPECT_EQ(read.ptr<float>(row)[column * channels + channels - 1 - c], image.at(column, row, c))
                << name;
    }
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
