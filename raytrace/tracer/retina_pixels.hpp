#pragma once
#include <vector>

#include "raytrace/eye/eye_model.hpp"
#include "raytrace/tracer/pupil_aim.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {

/// What the kernels know of every pixel: retina point, aim ellipse and normal, `floats_a_pixel` each (PIXEL
/// in kernels/trace.cl), row after row from the picture's top; and the area of the ellipse.
struct RetinaPixels {
  static constexpr int floats_a_pixel = 12;
  std::vector<float> values;
  std::vector<float> area_mm2;
};

/// \throw Error (input_invalid) when the retina does not fill the grid
RetinaPixels make_pixels(const EyeModel& eye, const RetinalGrid& grid, const PupilAim& aim, int threads);

}  // namespace emmetrope::raytrace
