#pragma once
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {

/// What moves while a picture is taken, evenly about the middle of the exposure; objects move as the scene
/// says.
struct Exposure {
  Eigen::Vector2d eye_motion_deg{0, 0};  ///< change of gaze, left and up
  int steps = 32;                        ///< positions that the picture is the mean of
};

/// As Tracer::trace. A spectacle (surfaces whose names begin with "spectacle") stays with the head while the
/// eye turns. Where nothing moves it is one trace.
/// \throw Error (usage) for fewer samples than steps
TraceResult trace_exposure(const Tracer& tracer, const EyeModel& eye, const Scene& scene,
                           const TraceSettings& settings, const Exposure& exposure);

}  // namespace emmetrope::raytrace
