#include "raytrace/picture/trace_settings.hpp"

#include <cmath>

#include "pipeline/base/error.hpp"

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

const char* to_string(Projection projection) {
  switch (projection) {
    case Projection::retina_plane:
      return "retina_plane";
    case Projection::retina_arc:
      return "retina_arc";
    case Projection::visual_angle:
      return "visual_angle";
    case Projection::perspective:
      return "perspective";
  }
  return "";
}

void RetinalGrid::check() const {
  if (width < 1 || height < 1 || width > 16384 || height > 16384)
    throw usage_error("--size: " + std::to_string(width) + "x" + std::to_string(height) + " is no image size",
                      "give 1x1 to 16384x16384");
  if (!is_angular() && !(field_x_mm > 0 && field_y_mm > 0 && std::isfinite(field_x_mm + field_y_mm)))
    throw usage_error("--field-mm: the field must be larger than 0");
  if (!centre_mm.allFinite()) throw usage_error("centre_mm: two finite numbers are wanted");
  const double most_deg = projection == Projection::perspective ? 170 : 250;
  if (is_angular() && !(field_deg.minCoeff() > 0 && field_deg.maxCoeff() <= most_deg))
    throw usage_error("--field-deg: the field is out of range",
                      "give more than 0 and at most 250 degrees, 170 in perspective");
}

void TraceSettings::check() const {
  if (method == Method::paper && illuminance)
    throw usage_error("--illuminance: the paper's rays are not spread evenly over the pupil",
                      "leave out --method paper");
  grid.check();
  if (grid.projection != Projection::retina_plane &&
      (method == Method::paper || representation == Representation::fast))
    throw usage_error("--method paper and --surfaces fast know the projection retina-plane only",
                      "leave out --field-deg and --projection, or them");
  if (samples < 1 || samples > 1'000'000)
    throw usage_error("--samples: " + std::to_string(samples) + " is out of range", "give 1 to 1000000");
  if (wavelength_nm && !(*wavelength_nm >= 380 && *wavelength_nm <= 900))  // aberrometers use 840
    throw usage_error("--wavelength: " + std::to_string(*wavelength_nm) + " nm is out of range",
                      "give 380 to 900");
  if (!(stiles_crawford_per_mm2 >= 0 && stiles_crawford_per_mm2 <= 1))
    throw usage_error(
        "--stiles-crawford: " + std::to_string(stiles_crawford_per_mm2) + " per mm^2 is out of range",
        "give 0 to 1; 0.05 is usual");
  if (method == Method::paper && (stiles_crawford_per_mm2 > 0 || diffraction))
    throw usage_error("--method paper knows neither diffraction nor the Stiles-Crawford effect");
  if (target_error && !(*target_error > 0))
    throw usage_error("--target-error: the standard error must be larger than 0", "such as 0.5");
  if (achromatic && (wavelength_nm || representation == Representation::fast))
    throw usage_error("--achromatic goes with neither --wavelength nor --surfaces fast");
  pose.check();
}

}  // namespace emmetrope::raytrace
