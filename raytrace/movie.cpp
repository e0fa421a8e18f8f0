#include "raytrace/movie.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/write_beside.hpp"
#include "raytrace/eye_picture.hpp"
#include "raytrace/movement/retinal_slip.hpp"
#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

constexpr int most_frames = 10'000;

int frame_count(const Movement& movement, double frame_rate_hz) {
  const double frames = std::max(1.0, std::round(movement.duration_s() * frame_rate_hz));
  if (!(frames <= most_frames))
    throw usage_error(
        fmt::format("--movement: {:g} s at {:g} frames a second are {:g} frames, {} are the most",
                    movement.duration_s(), frame_rate_hz, frames, most_frames),
        "give a shorter movement or a lower --frame-rate");
  return static_cast<int>(frames);
}

/// The time that one picture is exposed.
struct Frame {
  double first_s, last_s;
  double at(double share) const { return first_s + share * (last_s - first_s); }
  double middle_s() const { return at(0.5); }
};

/// One eye's movie, frame by frame.
class Filming {
 public:
  Filming(const Tracer& tracer, const EyeInState& eye_in_state, Laterality side, const Scene& scene,
          const TraceSettings& trace, const Exposure& exposure, Movement movement)
      : tracer_(tracer),
        eye_in_state_(eye_in_state),
        side_(side),
        scene_(scene),
        trace_(trace),
        exposure_(exposure),
        movement_(std::move(movement)) {}

  EyeModel eye_at(double time_s) const {
    const EyeMoment moment = movement_.at(time_s);
    return eye_in_state_(moment.accommodation_D, moment.pupil_mm);
  }

  TraceResult picture(const Frame& frame, const EyeModel& eye, int steps) const {
    return mean_over_steps(steps, trace_.illuminance, [&](int k) {
      const double time_s = frame.at((k + 0.5) / steps);
      TraceSettings now = of_step(trace_, k, steps);
      now.pose.gaze = movement_.at(time_s).gaze_of(side_);
      const double share = (time_s - movement_.first_s()) / movement_.duration_s() - 0.5;
      return trace_turned(tracer_, eye, moves(scene_) ? at_time(scene_, share) : scene_, now);
    });
  }

  /// A step a pixel that the gaze crosses, along the way that it takes.
  int steps_of(const Frame& frame, double pixel_deg) const {
    if (moves(scene_)) return exposure_.steps;
    constexpr int parts = 32;
    double way_deg = 0;
    Gaze last = movement_.at(frame.first_s).gaze_of(side_);
    for (int k = 1; k <= parts; ++k) {
      const Gaze next = movement_.at(frame.at(static_cast<double>(k) / parts)).gaze_of(side_);
      way_deg += std::hypot(next.horizontal_deg - last.horizontal_deg, next.vertical_deg - last.vertical_deg);
      last = next;
    }
    return static_cast<int>(
        std::clamp(std::ceil(way_deg / pixel_deg), 1.0, static_cast<double>(exposure_.steps)));
  }

  std::optional<RetinalSlip> slip(const Frame& frame, const EyeModel& eye) const {
    return retinal_slip(eye, trace_.pose, movement_, side_, frame.middle_s(), trace_.grid.centre_mm,
                        trace_.wavelength_nm.value_or(eye.reference_wavelength_nm));
  }

  const Movement& movement() const { return movement_; }

 private:
  const Tracer& tracer_;
  const EyeInState& eye_in_state_;
  Laterality side_;
  const Scene& scene_;
  const TraceSettings& trace_;
  const Exposure& exposure_;
  Movement movement_;
};

/// The columns of movement.json.
class Table {
 public:
  void add(const EyeMoment& moment, Laterality side, const EyeModel& eye,
           const std::optional<RetinalSlip>& slip, int steps) {
    const Gaze gaze = moment.gaze_of(side);
    const auto pair = [](const Eigen::Vector2d& v) { return Json{v.x(), v.y()}; };
    json_["time_s"].push_back(moment.time_s);
    json_["horizontal_deg"].push_back(gaze.horizontal_deg);
    json_["vertical_deg"].push_back(gaze.vertical_deg);
    json_["vergence_deg"].push_back(moment.vergence_deg);
    json_["accommodation_D"].push_back(moment.accommodation_D);
    json_["pupil_mm"].push_back(eye.stop() != nullptr ? Json(eye.stop()->stop_diameter_mm) : Json(nullptr));
    json_["retinal_slip_mm_s"].push_back(slip ? pair(slip->image_mm_s) : Json(nullptr));
    json_["retinal_slip_deg_s"].push_back(slip ? pair(slip->direction_deg_s) : Json(nullptr));
    json_["steps"].push_back(steps);
  }
  const Json& json() const { return json_; }

 private:
  Json json_ = Json::object();
};

/// H.264 of the frames' files.
void write_mp4(const fs::path& file, double frame_rate_hz, const std::vector<fs::path>& frames) {
  write_beside(file, [&](const fs::path& part) {
    cv::VideoWriter writer;
    for (const fs::path& frame : frames) {
      const cv::Mat picture = cv::imread(frame.string(), cv::IMREAD_COLOR);
      if (!writer.isOpened() &&
          !writer.open(part.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'),
                       frame_rate_hz, picture.size()))
        return false;
      writer.write(picture);
    }
    return true;
  });
}

}  // namespace

void MovieSettings::check(const TraceSettings& trace) const {
  if (!(frame_rate_hz >= 1 && frame_rate_hz <= 10'000))
    throw usage_error(fmt::format("--frame-rate: {:g} is out of range", frame_rate_hz),
                      "give 1 to 10000 a second");
  if (trace.grid.width % 2 != 0 || trace.grid.height % 2 != 0)
    throw usage_error("--size: a movie's width and height are even numbers", "write --size 300x300");
  frame_count(make_movement(movement, trace.seed), frame_rate_hz);
}

void write_movie(const Tracer& tracer, const EyeInState& eye_in_state, Laterality side, const Scene& scene,
                 const TraceSettings& trace, const Exposure& exposure, const MovieSettings& settings,
                 const fs::path& folder) {
  settings.check(trace);
  exposure.check();
  TraceSettings of_frame = trace;
  of_frame.verbosity.quiet = true;
  const Filming filming(tracer, eye_in_state, side, scene, of_frame, exposure,
                        make_movement(settings.movement, trace.seed));
  const int frames = frame_count(filming.movement(), settings.frame_rate_hz);
  remove_movie(folder);
  fs::create_directories(folder / "frames");
  const Json scale = scale_of(filming.eye_at(filming.movement().first_s()), trace);
  const double pixel_deg =
      scale["arcmin_per_pixel"][0].is_number() ? scale["arcmin_per_pixel"][0].get<double>() / 60 : 0.01;
  Table table;
  std::vector<fs::path> pictures;
  Progress progress("filming", frames, trace.verbosity);
  for (int k = 0; k < frames; ++k) {
    const double first_s = filming.movement().first_s() + k / settings.frame_rate_hz;
    const Frame frame{first_s, first_s + 1 / settings.frame_rate_hz};
    const EyeModel eye = filming.eye_at(frame.middle_s());
    const int steps = filming.steps_of(frame, pixel_deg);
    const TraceResult picture = filming.picture(frame, eye, steps);
    pictures.push_back(folder / "frames" / fmt::format("{:04}.png", k));
    write_png(pictures.back(), with_cover(picture.image, picture.unseen));
    EyeMoment middle = filming.movement().at(frame.middle_s());
    middle.time_s = frame.middle_s();
    table.add(middle, side, eye, filming.slip(frame, eye), steps);
    progress.advance();
  }
  write_mp4(folder / "movie.mp4", settings.frame_rate_hz, pictures);
  Json json = table.json();
  json["movement"] = filming.movement().name();
  json["frame_rate_hz"] = settings.frame_rate_hz;
  json["scale"] = scale;
  write_json(folder / "movement.json", json);
}

void remove_movie(const fs::path& folder) {
  fs::remove(folder / "movie.mp4");
  fs::remove(folder / "movement.json");
  fs::remove_all(folder / "frames");
}

}  // namespace emmetrope::raytrace
