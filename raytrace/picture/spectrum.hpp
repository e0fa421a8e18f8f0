#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>

namespace emmetrope::raytrace {

inline constexpr int wavelength_count = 16;

/// The wavelengths of spectral rays and what each adds to the colour.
struct Spectrum {
  std::array<double, wavelength_count> wavelength_nm;
  /// Linear sRGB of the image = sum over wavelengths of matrix x linear sRGB of the scene. The matrices add
  /// up to the identity: without blur a scene keeps its colours.
  std::array<Eigen::Matrix3d, wavelength_count> rgb_from_rgb;
};

/// 16 wavelengths of equal share in the light that the eye's receptors take from a white display.
///
/// The scene is a display with three smooth non-negative primaries, each the flattest spectrum that has the
/// chromaticity and luminance of its sRGB primary (IEC 61966-2-1) for the CIE 1931 observer; the observer is
/// the multi-lobe fit of Wyman, Sloan and Shirley, J. Computer Graphics Techniques 2(2), 2013.
Spectrum display_spectrum();

/// Spectra of the display's red, green and blue, relative; linear between 390 and 700 nm, 0 outside.
class DisplayPrimaries {
 public:
  DisplayPrimaries();
  Eigen::Vector3d at(double wavelength_nm) const;

 private:
  Eigen::Matrix<double, Eigen::Dynamic, 3> power_;
};

/// CIE 1931 2 degree colour matching functions x, y, z.
Eigen::Vector3d cie_1931(double wavelength_nm);

/// Linear sRGB from CIE XYZ, D65 white.
Eigen::Matrix3d srgb_from_xyz();

/// The transfer function of sRGB: what a linear value of 0 to 1 is encoded as, 0 to 1.
double srgb_encoded(double linear);
double srgb_decoded(double encoded);

}  // namespace emmetrope::raytrace
