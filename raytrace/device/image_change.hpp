#pragma once
#include <array>
#include <vector>

#include "raytrace/device/device_scene.hpp"
#include "raytrace/picture/eye_tangent.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/picture/trace_settings.hpp"

namespace emmetrope::raytrace {

/// How the texture coordinates that a ray meets on each plane move with parameters of the eye, the retina
/// point and the place in the pupil held: polynomials of that place for every pixel (kernels/scene.cl). They
/// are smooth where pictures are not, so that few exact rays of the two eyes that bracket a parameter give
/// them.
struct ImageChange {
  int degree = 3;
  int floats_a_pixel = 0;      ///< planes x parameters x {u, v} x (1, or 2 for several wavelengths) x terms
  std::vector<float> values;   ///< pixels row after row from the picture's top
  std::vector<float> by_wave;  ///< what multiplies a second polynomial, for each of the wavelengths
};

/// Fits the polynomials to exactly traced rays (float64) and checks them against others at random, of each plane that
/// is seen; on one that none of some thousand rays meets nothing moves.
/// \throw Error (unsupported) where they miss those by more than 0.5 % (rms): parts of the field see the
///   scene past an edge within the eye, or a plane edge on
ImageChange make_image_change(const std::vector<EyeTangent>& tangents, const DeviceScene& scene,
                              const RetinalGrid& grid,
                              const std::array<double, wavelength_count>& wavelength_nm, int threads);

}  // namespace emmetrope::raytrace
