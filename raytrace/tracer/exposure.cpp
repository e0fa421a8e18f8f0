#include "raytrace/tracer/exposure.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::raytrace {
namespace {

/// Sums of pictures: of light, and of how often each pixel saw anything.
class PictureMean {
 public:
  void add(const TraceResult& step, bool illuminance) {
    const std::vector<float>& light = step.image.values;
    // With illuminance a step counts in multiples of its own middle's light.
    const double unit = illuminance ? step.middle_projected_sr : 1;
    sums_.resize(light.size());
    for (std::size_t i = 0; i < light.size(); ++i) sums_[i] += unit * light[i];
    seen_.resize(light.size() / 3);
    for (std::size_t pixel = 0; pixel < seen_.size(); ++pixel)
      seen_[pixel] += step.unseen.empty() || step.unseen[pixel] == 0 ? 1 : 0;
    ++steps_;
  }

  /// \param result  of the first step
  void finish(TraceResult& result, bool illuminance) const {
    const double unit = illuminance && result.middle_projected_sr > 0 ? result.middle_projected_sr : 1;
    for (std::size_t i = 0; i < sums_.size(); ++i) {
      // What falls on a pixel is a mean over time; what it sees, over the time in which it sees.
      const int times = illuminance ? steps_ : std::max(seen_[i / 3], 1);
      result.image.values[i] = static_cast<float>(sums_[i] / unit / times);
    }
    const bool sees_all = std::all_of(seen_.begin(), seen_.end(), [](int times) { return times > 0; });
    result.unseen.assign(sees_all ? 0 : seen_.size(), 0);
    for (std::size_t pixel = 0; pixel < result.unseen.size(); ++pixel)
      result.unseen[pixel] = seen_[pixel] == 0;
  }

 private:
  std::vector<double> sums_;
  std::vector<int> seen_;
  int steps_ = 0;
};

}  // namespace

void Exposure::check() const {
  constexpr int most = 1024;
  if (steps < 2 || steps > most)
    throw usage_error("--exposure-steps: " + std::to_string(steps) + " is out of range",
                      "give 2 to " + std::to_string(most));
}

TraceResult trace_turned(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                         const TraceSettings& settings) {
  return tracer.trace(fixed_to_head(eye, settings.pose.turned_from_straight()), scene, settings);
}

TraceResult trace_exposure(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                           const TraceSettings& settings, const Exposure& exposure) {
  if (exposure.eye_motion_deg.isZero(0) && !moves(scene)) return trace_turned(tracer, eye, scene, settings);
  exposure.check();
  return mean_over_steps(exposure.steps, settings.illuminance, [&](int k) {
    const double time = (k + 0.5) / exposure.steps - 0.5;
    TraceSettings now = of_step(settings, k, exposure.steps);
    now.pose.gaze.horizontal_deg += time * exposure.eye_motion_deg.x();
    now.pose.gaze.vertical_deg += time * exposure.eye_motion_deg.y();
    return trace_turned(tracer, eye, at_time(scene, time), now);
  });
}

TraceSettings of_step(const TraceSettings& settings, int step, int steps) {
  TraceSettings now = settings;
  now.samples = (settings.samples + steps - 1) / steps;
  // Steps have noise of their own: the mean's error is theirs over the root of their number.
  if (settings.target_error) now.target_error = *settings.target_error * std::sqrt(steps);
  now.seed = settings.seed + 1000003U * static_cast<std::uint64_t>(step);  // no step repeats another's noise
  return now;
}

TraceResult mean_over_steps(int steps, bool illuminance, const std::function<TraceResult(int)>& trace_step) {
  TraceResult result;
  PictureMean mean;
  for (int k = 0; k < steps; ++k) {
    TraceResult step = trace_step(k);
    mean.add(step, illuminance);
    if (k == 0) {
      result = std::move(step);
      continue;
    }
    for (const auto& [state, count] : step.states) result.states[state] += count;
    result.rays += step.rays;
    result.samples += step.samples;
    if (result.error) result.error = std::hypot(*result.error, *step.error);
    result.wall_s += step.wall_s;
  }
  mean.finish(result, illuminance);
  if (result.error) *result.error /= steps;
  return result;
}

}  // namespace emmetrope::raytrace
