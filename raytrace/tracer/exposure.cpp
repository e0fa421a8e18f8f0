#include "raytrace/tracer/exposure.hpp"

#include <cmath>

#include "pipeline/base/error.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::raytrace {
namespace {

TraceResult trace_turned(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                         const TraceSettings& settings) {
  return tracer.trace(fixed_to_head(eye, settings.pose.turned_from_straight()), scene, settings);
}

}  // namespace

void Exposure::check() const {
  constexpr int most = 1024;
  if (steps < 2 || steps > most)
    throw usage_error("--exposure-steps: " + std::to_string(steps) + " is out of range",
                      "give 2 to " + std::to_string(most));
}

TraceResult trace_exposure(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                           const TraceSettings& settings, const Exposure& exposure) {
  if (exposure.eye_motion_deg.isZero(0) && !moves(scene)) return trace_turned(tracer, eye, scene, settings);
  exposure.check();
  TraceResult mean;
  for (int k = 0; k < exposure.steps; ++k) {
    const double time = (k + 0.5) / exposure.steps - 0.5;
    TraceSettings now = settings;
    now.samples = (settings.samples + exposure.steps - 1) / exposure.steps;
    // Steps have noise of their own: the mean's error is theirs over the root of their number.
    if (settings.target_error) now.target_error = *settings.target_error * std::sqrt(exposure.steps);
    now.seed = settings.seed + 1000003U * static_cast<std::uint64_t>(k);  // no step repeats another's noise
    now.pose.gaze.horizontal_deg += time * exposure.eye_motion_deg.x();
    now.pose.gaze.vertical_deg += time * exposure.eye_motion_deg.y();
    TraceResult step = trace_turned(tracer, eye, at_time(scene, time), now);
    if (k == 0) {
      mean = std::move(step);
      continue;
    }
    for (std::size_t i = 0; i < mean.image.values.size(); ++i) mean.image.values[i] += step.image.values[i];
    for (const auto& [state, count] : step.states) mean.states[state] += count;
    mean.rays += step.rays;
    mean.samples += step.samples;
    if (mean.error) mean.error = std::hypot(*mean.error, *step.error);
    mean.wall_s += step.wall_s;
  }
  for (float& value : mean.image.values) value /= static_cast<float>(exposure.steps);
  if (mean.error) *mean.error /= exposure.steps;
  return mean;
}

}  // namespace emmetrope::raytrace
