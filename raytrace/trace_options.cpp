#include "raytrace/trace_options.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "raytrace/retina/field_points.hpp"

namespace emmetrope::raytrace {

void TraceOptions::check() const {
  settings.check();
  for (const auto& [eye, pose] : poses) pose.check();
  if (psf_grid) psf_grid->check();
  if (irradiance) irradiance->check();
  exposure.check();
  if (movie) movie->check(settings);
  for (const auto& [eye, marks] : landmarks) {
    if (marks.fovea) marks.fovea->check("--fovea");
    if (marks.disc) marks.disc->check("--disc");
  }
  if (irradiance && (settings.wavelength_nm || settings.achromatic || settings.method == Method::paper))
    throw usage_error("--irradiance traces every band by its own rays, spread evenly over the pupil",
                      "leave out --wavelength (--bands gives them), --achromatic and --method paper");
  const Eigen::Vector2d half = half_of(settings.grid);
  if (irradiance && irradiance_files.formats.count("isetbio") > 0 &&
      std::abs(half.x() * settings.grid.height / (half.y() * settings.grid.width) - 1) > 0.01)
    throw usage_error("--irradiance-format isetbio: its pixels are square",
                      "give --size and --field-mm, or --field-deg, of one shape");
  constexpr double widest_flat_deg = 40;
  if (irradiance && irradiance_files.formats.count("isetbio") > 0 &&
      (settings.grid.projection == Projection::retina_arc ||
       (settings.grid.is_angular() && settings.grid.field_deg.maxCoeff() > widest_flat_deg)))
    throw usage_error("--irradiance-format isetbio: its picture is flat, behind a thin lens",
                      "give --field-mm, or a --field-deg of 40 at most");
  if (const auto* cylinder = spectacle ? std::get_if<PlanoCylinder>(&*spectacle) : nullptr) cylinder->check();
  constexpr double narrowest_mm = 30, widest_mm = 90;  // from newborns to giants
  if (pupillary_distance_mm &&
      !(*pupillary_distance_mm >= narrowest_mm && *pupillary_distance_mm <= widest_mm))
    throw usage_error(
        fmt::format("--pupillary-distance: {:g} mm are of no pair of eyes", *pupillary_distance_mm),
        fmt::format("give {:g} to {:g}, such as 62", narrowest_mm, widest_mm));
}

TraceSettings TraceOptions::settings_of(Laterality eye) const {
  TraceSettings own = settings;
  own.pose = poses.at(eye);
  return own;
}

Landmarks TraceOptions::landmarks_of(Laterality eye) const {
  const auto found = landmarks.find(eye);
  return found == landmarks.end() ? Landmarks() : found->second;
}

EyeModel TraceOptions::with_worn(const EyeModel& eye) const {
  return spectacle ? with_spectacle(eye, *spectacle) : eye;
}

}  // namespace emmetrope::raytrace
