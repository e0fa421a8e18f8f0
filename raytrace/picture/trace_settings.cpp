#include "raytrace/picture/trace_settings.hpp"

namespace emmetrope::raytrace {

const char* to_string(Representation representation) {
  switch (representation) {
    case Representation::analytic:
      return "analytic";
    case Representation::triangles:
      return "triangles";
    case Representation::smooth:
      return "smooth";
    case Representation::fast:
      return "fast";
    case Representation::every_triangle:
      return "every_triangle";
  }
  return "";
}

const char* to_string(Method method) { return method == Method::paper ? "paper" : "pupil"; }

}  // namespace emmetrope::raytrace
