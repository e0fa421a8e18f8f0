#include "raytrace/trace_options.hpp"

#include "pipeline/base/error.hpp"

namespace emmetrope::raytrace {

void TraceOptions::check() const {
  settings.check();
  for (const auto& [eye, pose] : poses) pose.check();
  if (psf_grid) psf_grid->check();
  if (irradiance) irradiance->check();
  if (irradiance && (settings.wavelength_nm || settings.achromatic || settings.method == Method::paper))
    throw usage_error("--irradiance traces every band by its own rays, spread evenly over the pupil",
                      "leave out --wavelength (--bands gives them), --achromatic and --method paper");
  if (const auto* cylinder = spectacle ? std::get_if<PlanoCylinder>(&*spectacle) : nullptr) cylinder->check();
  if (pupillary_distance_mm && !(*pupillary_distance_mm > 0 && *pupillary_distance_mm < 120))
    throw usage_error(
        "--pupillary-distance: " + std::to_string(*pupillary_distance_mm) + " mm is out of range",
        "give up to 120, such as 62");
}

TraceSettings TraceOptions::settings_of(Laterality eye) const {
  TraceSettings own = settings;
  own.pose = poses.at(eye);
  return own;
}

EyeModel TraceOptions::with_worn(const EyeModel& eye) const {
  return spectacle ? with_spectacle(eye, *spectacle) : eye;
}

}  // namespace emmetrope::raytrace
