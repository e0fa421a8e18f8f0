#pragma once
#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/spectacle/spectacle.hpp"

/// Eyes with a known error of refraction, as formulas.
namespace emmetrope::correction {

/// Navarro's eye with another front cornea: biconic with the given powers of curvature.
/// \param radius_mm  mean radius;
/// \param cylinder_D its toricity (376 times the difference of curvatures) with the flat meridian at flat_deg
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

/// The paper's Fig. 7: an ellipsoidal front cornea, its horizontal semi-axis `ratio` times the others, in
/// Gullstrand's eye; the vertical meridian stays emmetropic.
inline EyeModel figure_seven_eye(double ratio) {
  EyeModel eye = make_eye("gullstrand");
  constexpr double axis_mm = 7.7;
  eye.surface("cornea_anterior").shape = make_ellipsoid({axis_mm * ratio, axis_mm, axis_mm}, 0);
  return eye;
}

/// A lens of -6 to +6 D with up to 2 D of cylinder.
inline PowerVector known_lens(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> sphere(-6, 6), cylinder(-2, 0), axis(0, 180);
  const double sphere_D = sphere(random), cylinder_D = cylinder(random), axis_deg = axis(random);
  return to_power_vector({sphere_D, cylinder_D, axis_deg});
}

/// It stands 12 mm before the cornea, its plane front 4 mm before that.
inline EyeModel behind_known_lens(const EyeModel& eye, const PowerVector& lens) {
  EyeModel behind = raytrace::with_thin_lens(eye, lens, 12);
  behind.surface("spectacle_front").name = "known_front";
  behind.surface("spectacle_back").name = "known_back";
  return behind;
}
inline constexpr double beyond_known_lens_mm = 18;

/// What corrects an emmetropic eye behind that lens, at `beyond_known_lens_mm`, meridian by meridian: the
/// light that leaves the plane front has the vergence that the glass makes of the lens's own.
inline Eigen::Vector3d refraction_behind(const PowerVector& lens) {
  const SpheroCylinder notation = to_sphero_cylinder(lens);
  const auto meridian_D = [](double power_D) {
    const double at_front_D = -power_D / (1 - 0.004 / 1.5 * power_D);
    return at_front_D / (1 + (beyond_known_lens_mm - 16) * 1e-3 * at_front_D);
  };
  const double sphere_D = meridian_D(notation.sphere_D);
  const PowerVector power = to_power_vector(
      {sphere_D, meridian_D(notation.sphere_D + notation.cylinder_D) - sphere_D, notation.axis_deg});
  return {power.M_D, power.J0_D, power.J45_D};
}

}  // namespace emmetrope::correction
