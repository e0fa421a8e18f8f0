#include "raytrace/movie.hpp"

#include <fmt/format.h>
#include <sched.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/scratch_folder.hpp"
#include "pipeline/base/write_beside.hpp"
#include "raytrace/eye_picture.hpp"
#include "raytrace/movement/retinal_slip.hpp"
#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

constexpr int most_frames = 10'000;

int frame_count(const Movement& movement, double frame_rate_hz) {
  if (movement.duration_s() * frame_rate_hz < 0.999)
    throw usage_error(fmt::format("--movement: its {:g} s are less than a frame of {:g} s",
                                  movement.duration_s(), 1 / frame_rate_hz),
                      "give a longer movement or a higher --frame-rate");
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
  int number;
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
    TraceSettings own = trace_;
    own.seed += 15485863U * static_cast<std::uint64_t>(frame.number);  // no frame repeats another's noise
    return mean_over_steps(steps, own.illuminance, [&](int k) {
      const double time_s = frame.at((k + 0.5) / steps);
      TraceSettings now = of_step(own, k, steps);
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

/// While it lives this thread, and what it starts, has one processor: the encoder divides pictures among as many threads
/// as it may use processors, and its bytes are to be the same everywhere.
class OnOneProcessor {
 public:
  OnOneProcessor() {
    if (sched_getaffinity(0, sizeof before_, &before_) != 0) return;
    cpu_set_t one;
    CPU_ZERO(&one);
    for (int k = 0; k < CPU_SETSIZE && CPU_COUNT(&one) == 0; ++k)
      if (CPU_ISSET(k, &before_)) CPU_SET(k, &one);
    changed_ = sched_setaffinity(0, sizeof one, &one) == 0;
  }
  ~OnOneProcessor() {
    if (changed_) sched_setaffinity(0, sizeof before_, &before_);
  }
  OnOneProcessor(const OnOneProcessor&) = delete;
  OnOneProcessor& operator=(const OnOneProcessor&) = delete;

 private:
  cpu_set_t before_{};
  bool changed_ = false;
};

/// H.264 of the frames' files.
void write_mp4(const fs::path& file, double frame_rate_hz, const std::vector<fs::path>& frames) {
  write_beside(
      fs::absolute(file), [&](const fs::path& part) {  // what stands before a colon would be a protocol
        const OnOneProcessor same_bytes_everywhere;
        cv::VideoWriter writer;
        for (const fs::path& frame : frames) {
          const cv::Mat picture = cv::imread(frame.string(), cv::IMREAD_COLOR);
          if (!writer.isOpened() &&
              !writer.open(part.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'),
                           frame_rate_hz, picture.size()))
            return false;
          writer.write(picture);
        }
        writer.release();
        // A full disk is not told while it is written.
        return cv::VideoCapture(part.string()).get(cv::CAP_PROP_FRAME_COUNT) ==
               static_cast<double>(frames.size());
      });
}

/// A movie is made inside the output's folder, to be moved into it whole.
class Studio {
 public:
  explicit Studio(const fs::path& output) : output_(output), scratch_(output / ".writing-movie") {
    fs::create_directory(folder() / "frames");
  }

  const fs::path& folder() const { return scratch_.path(); }
  void publish() const {
    const auto together = hold_interrupts();
    remove_movie(output_);
    fs::create_directories(output_ / "frames");
    for (const auto& frame : fs::directory_iterator(folder() / "frames"))
      fs::rename(frame.path(), output_ / "frames" / frame.path().filename());
    for (const char* name : {"movie.mp4", "movement.json"}) fs::rename(folder() / name, output_ / name);
  }

 private:
  fs::path output_;
  ScratchFolder scratch_;
};

fs::path frame_file(const fs::path& folder, int number) {
  return folder / "frames" / fmt::format("{:04}.png", number);
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

void require_states(const EyeInState& eye_in_state, const std::string& movement, std::uint64_t seed) {
  const Movement moves = make_movement(movement, seed);
  const auto less = [](const EyeMoment& a, const EyeMoment& b) {
    return a.accommodation_D < b.accommodation_D;
  };
  const auto [far, near] = std::minmax_element(moves.moments().begin(), moves.moments().end(), less);
  for (const EyeMoment& moment : {*far, *near}) try {
      eye_in_state(moment.accommodation_D, moment.pupil_mm);
    } catch (Error& error) {
      error.add_context(
          fmt::format("making the eye at {:g} s of the movement {}", moment.time_s, moves.name()));
      throw;
    }
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
  if (const double least_D = filming.movement().least_accommodation_D(); least_D < 0)
    spdlog::warn("movement {}: accommodation_D down to {:g} is taken for 0: no eye is less than relaxed",
                 filming.movement().name(), least_D);
  const int frames = frame_count(filming.movement(), settings.frame_rate_hz);
  const Studio studio(folder);
  const Json scale = scale_of(filming.eye_at(filming.movement().first_s()), trace);
  const double pixel_deg =
      scale["arcmin_per_pixel"][0].is_number() ? scale["arcmin_per_pixel"][0].get<double>() / 60 : 0.01;
  Table table;
  std::vector<fs::path> pictures;
  Progress progress("filming", frames, trace.verbosity);
  for (int k = 0; k < frames; ++k) {
    const double first_s = filming.movement().first_s() + k / settings.frame_rate_hz;
    const Frame frame{k, first_s, first_s + 1 / settings.frame_rate_hz};
    const EyeModel eye = filming.eye_at(frame.middle_s());
    const int steps = filming.steps_of(frame, pixel_deg);
    const TraceResult picture = filming.picture(frame, eye, steps);
    pictures.push_back(frame_file(studio.folder(), k));
    write_png(pictures.back(), with_cover(picture.image, picture.unseen));
    EyeMoment middle = filming.movement().at(frame.middle_s());
    middle.time_s = frame.middle_s();
    table.add(middle, side, eye, filming.slip(frame, eye), steps);
    progress.advance();
  }
  Json json = table.json();
  json["movement"] = filming.movement().name();
  json["frame_rate_hz"] = settings.frame_rate_hz;
  json["scale"] = scale;
  write_json(studio.folder() / "movement.json", json);
  write_mp4(studio.folder() / "movie.mp4", settings.frame_rate_hz, pictures);
  studio.publish();
}

void remove_movie(const fs::path& folder) {
  // What lies there under these names without a movie's own table is somebody else's.
  const fs::path table = folder / "movement.json";
  if (!fs::exists(table)) return;
  const Json json = read_json(table);
  if (!json.is_object() || !json.contains("retinal_slip_mm_s")) return;
  for (std::size_t k = 0; k < json["retinal_slip_mm_s"].size(); ++k)
    fs::remove(frame_file(folder, static_cast<int>(k)));
  std::error_code not_empty;
  fs::remove(folder / "frames", not_empty);
  fs::remove(folder / "movie.mp4");
  fs::remove(table);
}

}  // namespace emmetrope::raytrace
