#pragma once
#include <filesystem>
#include <set>
#include <string>

#include "raytrace/radiometry/irradiance.hpp"

namespace emmetrope::raytrace {

/// In which forms the light on the retina is written.
struct IrradianceFiles {
  std::set<std::string> formats{"tiff", "mat"};  ///< of irradiance_formats
  bool photons = false;                          ///< spectral irradiance as photons / (s m^2 nm)
};
inline const std::set<std::string> irradiance_formats{"tiff", "exr", "mat", "isetbio"};

/// Into a folder: irradiance.json (wavelengths, units, what was assumed) and, by format,
/// - tiff: irradiance.tiff (a page of linear floats a band), cones.tiff (long, middle and short wavelength cones as the
///   three channels), trolands.tiff;
/// - exr: irradiance.exr (float_files.hpp);
/// - mat: irradiance.mat, all of them (MATLAB 5, pictures as height x width x bands);
/// - isetbio: optical-image.mat, the structure "oi" that isetbio's oiGet reads.
/// Pixels that see nothing are no numbers in the pictures.
/// \throw Error (no_result) for isetbio where the picture's middle sees nothing
void write_irradiance(RetinalIrradiance light, const EyeModel& eye, const TraceSettings& trace,
                      const IrradianceSettings& settings, const IrradianceFiles& files,
                      const std::filesystem::path& folder);
/// Takes those of an earlier eye away.
void remove_irradiance(const std::filesystem::path& folder);

}  // namespace emmetrope::raytrace
