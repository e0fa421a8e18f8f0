#pragma once
#include <filesystem>

#include "raytrace/radiometry/irradiance.hpp"

namespace emmetrope::raytrace {

/// Into a folder: irradiance.json (wavelengths, units, what was assumed), irradiance.tiff (a page of linear floats a
/// band), cones.tiff (long, middle and short wavelength cones as the three channels) and irradiance.mat (all of them,
/// MATLAB 5, pictures as height x width x bands). Pixels that see nothing are no numbers in the pictures.
void write_irradiance(RetinalIrradiance light, const EyeModel& eye, const TraceSettings& trace,
                      const IrradianceSettings& settings, const std::filesystem::path& folder);
/// Takes those of an earlier eye away.
void remove_irradiance(const std::filesystem::path& folder);

}  // namespace emmetrope::raytrace
