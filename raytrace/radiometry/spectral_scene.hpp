#pragma once
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// What the colours of a scene stand for: a display with the smoothest primaries of sRGB, whose white has this
/// luminance (CIE 1924 photopic observer).
class DisplayLight {
 public:
  explicit DisplayLight(double luminance_cd_m2);
  /// Spectral radiance of linear red, green and blue of 1, W / (m^2 sr nm).
  Eigen::Vector3d radiance(double wavelength_nm) const;

 private:
  DisplayPrimaries primaries_;
  double scale_ = 0;
};

/// A scene in the light of one wavelength: grey.
struct SceneAtWavelength {
  Scene scene;
  double unit = 0;  ///< spectral radiance of the value 1, W / (m^2 sr nm); 0 where there is no such light
};

/// Pictures with a spectrum show it; colours are mixed of the display's primaries, on lit surfaces as their share in
/// the display's white.
SceneAtWavelength at_wavelength(const Scene& scene, const DisplayLight& display, double wavelength_nm);

}  // namespace emmetrope::raytrace
