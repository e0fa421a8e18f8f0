#pragma once
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

}  // namespace emmetrope::raytrace
