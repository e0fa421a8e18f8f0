#pragma once
#include <Eigen/Core>
#include <vector>

namespace emmetrope::raytrace {

/// Values at rising wavelengths, as many of both, at least one; linear between them.
struct SampledSpectrum {
  std::vector<double> wavelength_nm, values;

  /// Nothing outside: of light.
  double at(double nm) const;
  /// The ends hold outside: of a surface.
  double held_at(double nm) const;
};

/// Linear sRGB of a surface's share of the light that comes back, in the display's white (1 everywhere: white).
Eigen::Vector3d colour_of_reflectance(const SampledSpectrum& reflectance);
/// Linear sRGB of light, D65 white of the luminance of one unit (W / (m^2 sr), weighted by the CIE 1931 observer's y).
Eigen::Vector3d colour_of_light(const SampledSpectrum& radiance);

}  // namespace emmetrope::raytrace
