#include "raytrace/case/trace_picture.hpp"

namespace emmetrope::raytrace {
namespace {

bool is_given(const Json& parameters, const char* key) {
  return parameters.contains(key) && !parameters.at(key).is_null();
}

bool has_nonzero(const Json& numbers) {
  if (numbers.is_number()) return numbers.get<double>() != 0;
  if (!numbers.is_structured()) return false;
  for (const Json& part : numbers)
    if (has_nonzero(part)) return true;
  return false;
}

}  // namespace

std::string seen_otherwise(const Json& trace_parameters) {
  if (is_given(trace_parameters, "spectacle") || is_given(trace_parameters, "plano_cylinder"))
    return "through a spectacle";
  if (is_given(trace_parameters, "pupillary_distance_mm")) return "from beside the middle of the scene";
  if (has_nonzero(trace_parameters.value("motion_deg", Json()))) return "with a moving eye";
  if (has_nonzero(trace_parameters.value("gaze_deg", Json()))) return "with a turned eye";
  if (is_given(trace_parameters, "field_deg")) return "over a field in degrees";
  return {};
}

}  // namespace emmetrope::raytrace
