#pragma once
#include <functional>

#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {

/// What moves while a picture is taken, evenly about the middle of the exposure; objects move as the scene
/// says.
struct Exposure {
  Eigen::Vector2d eye_motion_deg{0, 0};  ///< change of gaze, left and up
  int steps = 32;                        ///< positions that the picture is the mean of

  /// \throw Error (usage) for a number of steps out of range
  void check() const;
};

/// As Tracer::trace. What the head bears, a spectacle, stays with it while the eye turns. Where nothing moves it is one trace.
/// \throw Error (usage) for steps out of range, where something moves
TraceResult trace_exposure(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                           const TraceSettings& settings, const Exposure& exposure);

/// The settings of one of several steps that share a picture's samples.
TraceSettings of_step(const TraceSettings& settings, int step, int steps);
/// The eye turned by its pose, with what the head bears where it is.
TraceResult trace_turned(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                         const TraceSettings& settings);
/// The picture of what is seen step by step: its light is the mean over all steps, its colours over those that see.
/// \param trace_step  of the same size each; with illuminance steps count by their own middle's light
TraceResult mean_over_steps(int steps, bool illuminance,
                            const std::function<TraceResult(int step)>& trace_step);

}  // namespace emmetrope::raytrace
