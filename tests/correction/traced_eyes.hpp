#pragma once
#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "raytrace/eye/eye_model.hpp"

/// Eyes with a known error of refraction, as formulas.
namespace emmetrope::correction {

/// Navarro's eye with another front cornea: biconic with the given powers of curvature.
/// \param radius_mm   mean radius; \param cylinder_D its toricity (376 times the difference of curvatures)
/// with the
///                    flat meridian at flat_deg
inline EyeModel with_cornea(EyeModel eye, double radius_mm, double cylinder_D, double flat_deg,
                            double q = -0.26) {
  const double c = 1 / radius_mm, half = cylinder_D / 376 / 2;
  eye.surface("cornea_anterior").shape =
      make_biconic(1 / (c - half), 1 / (c + half), q, q, normalise_axis_deg(flat_deg));
  return eye;
}

/// A random eye: corneal radius and axial length as in people, 0 to 5 D of corneal cylinder at any axis.
inline EyeModel random_eye(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> radius(7.4, 8.2), cylinder(0, 5), axis(0, 180), length(-1.2, 1.6);
  EyeModel eye = make_eye("navarro");
  const double radius_mm = radius(random), cylinder_D = cylinder(random), axis_deg = axis(random);
  eye = with_cornea(eye, radius_mm, cylinder_D, axis_deg);
  eye.surfaces.back().position_mm += length(random);
  return eye;
}

}  // namespace emmetrope::correction
