#include "raytrace/movie.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

EyeModel navarro(double accommodation_D, const std::optional<double>& pupil_mm) {
  EyeOptions options;
  options.accommodation_D = accommodation_D;
  options.pupil_mm = pupil_mm;
  return make_eye("navarro", options);
}

TraceSettings small_picture() {
  TraceSettings trace;
  trace.grid.width = trace.grid.height = 64;
  trace.grid.field_x_mm = trace.grid.field_y_mm = 0.64;
  trace.samples = 32;
  trace.verbosity.quiet = true;
  return trace;
}

TEST(Movie, FramesShowWhereTheEyeLooks) {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "m.csv",
             "time_s,horizontal_deg,accommodation_D,pupil_mm\n0,0,0,3\n0.1,0.5,1,3\n0.2,0.5,1,4\n");
  const Tracer tracer("");
  const auto scene = make_scene("letters:logmar=0.5,distance_mm=1000");
  TraceSettings trace = small_picture();
  write_movie(tracer, &navarro, Laterality::od, *scene, trace, {}, {(folder.path() / "m.csv").string(), 20},
              folder.path());
  const Json table = read_json(folder.path() / "movement.json");
  ASSERT_EQ(table["time_s"].size(), 4U);
  EXPECT_NEAR(table["time_s"][1].get<double>(), 0.075, 1e-12);
  EXPECT_NEAR(table["horizontal_deg"][1].get<double>(), 0.375, 1e-12);
  EXPECT_NEAR(table["accommodation_D"][1].get<double>(), 0.75, 1e-12);
  EXPECT_NEAR(table["pupil_mm"][3].get<double>(), 3.75, 1e-12);
  EXPECT_NEAR(table["retinal_slip_deg_s"][0][0].get<double>(), -5, 0.01);
  EXPECT_EQ(table["retinal_slip_mm_s"][3][0], 0);
  // 0.25 degrees a frame are some seven pixels of 2 arcmin; an eye at rest needs one step.
  EXPECT_NEAR(table["steps"][0].get<int>(), 7.5, 1);
  EXPECT_EQ(table["steps"][3], 1);

  // The last frame is the picture of that gaze, accommodation and pupil, but for its noise, which is its own.
  const auto still = [&](double horizontal_deg) {
    TraceSettings there = trace;
    there.pose.gaze.horizontal_deg = horizontal_deg;
    write_png(folder.path() / "still.png", trace_turned(tracer, navarro(1, 3.75), *scene, there).image);
    return cv::imread((folder.path() / "still.png").string());
  };
  const cv::Mat last = cv::imread((folder.path() / "frames" / "0003.png").string());
  const double levels = cv::norm(last, still(0.5), cv::NORM_L1) / (64 * 64 * 3);
  EXPECT_LT(levels, 12);
  EXPECT_GT(cv::norm(last, still(0.4), cv::NORM_L1) / (64 * 64 * 3), 2 * levels);
  EXPECT_NE(read_file(folder.path() / "frames" / "0003.png"),
            read_file(folder.path() / "frames" / "0002.png"));

  cv::VideoCapture movie((folder.path() / "movie.mp4").string());
  ASSERT_TRUE(movie.isOpened());
  EXPECT_EQ(movie.get(cv::CAP_PROP_FPS), 20);
  int frames = 0;
  for (cv::Mat frame; movie.read(frame); ++frames) EXPECT_EQ(frame.size(), cv::Size(64, 64));
  EXPECT_EQ(frames, 4);
  EXPECT_FALSE(fs::exists(folder.path() / ".writing-movie"));
  write_file(folder.path() / "frames" / "mine.txt", "kept");
  remove_movie(folder.path());
  EXPECT_FALSE(fs::exists(folder.path() / "movie.mp4"));
  EXPECT_FALSE(fs::exists(folder.path() / "frames" / "0000.png"));
  EXPECT_EQ(read_file(folder.path() / "frames" / "mine.txt"), "kept");
  write_file(folder.path() / "movie.mp4", "somebody's");
  remove_movie(folder.path());
  EXPECT_TRUE(fs::exists(folder.path() / "movie.mp4"));
}

TEST(Movie, RefusesWhatNoMovieIs) {
  const auto status = [](const MovieSettings& settings, const TraceSettings& trace) {
    try {
      settings.check(trace);
    } catch (const Error& error) {
      return error.status();
    }
    return ExitStatus::done;
  };
  const TraceSettings trace = small_picture();
  EXPECT_EQ(status({"saccade", 60}, trace), ExitStatus::done);
  EXPECT_EQ(status({"saccade", 0}, trace), ExitStatus::usage);
  EXPECT_EQ(status({"drift:duration_s=600", 1000}, trace), ExitStatus::usage);
  EXPECT_EQ(status({"drift:duration_s=0.01", 60}, trace), ExitStatus::usage);
  TraceSettings odd = trace;
  odd.grid.width = 63;
  EXPECT_EQ(status({"saccade", 60}, odd), ExitStatus::usage);
}

TEST(Movie, SaysWhenTheEyeCannotBeAsTheTableWants) {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "m.csv", "time_s,accommodation_D\n0,0\n0.5,40\n");
  try {
    require_states(&navarro, (folder.path() / "m.csv").string(), 1);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_NE(error.context().front().find("0.5 s"), std::string::npos);
  }
  write_file(folder.path() / "m.csv", "time_s,accommodation_D\n0,-0.05\n0.5,1\n");
  EXPECT_NO_THROW(require_states(&navarro, (folder.path() / "m.csv").string(), 1));
}

}  // namespace
}  // namespace emmetrope::raytrace
