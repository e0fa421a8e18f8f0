#pragma once
#include <Eigen/Core>

namespace emmetrope {

/// A refraction as Thibos' power vector, dioptres: M = S + C/2, J0 = -C/2 cos 2a, J45 = -C/2 sin 2a.
struct PowerVector {
  double M_D = 0;
  double J0_D = 0;
  double J45_D = 0;
};

/// A refraction in clinical notation, minus cylinder, axis 0 <= a < 180 degrees (TABO).
struct SpheroCylinder {
  double sphere_D = 0;
  double cylinder_D = 0;
  double axis_deg = 0;
};

/// (M, J0, J45)
inline Eigen::Vector3d as_vector(const PowerVector& power) { return {power.M_D, power.J0_D, power.J45_D}; }

/// Length of the difference in power-vector space.
double distance_D(const PowerVector& a, const PowerVector& b);

PowerVector to_power_vector(const SpheroCylinder& refraction);

/// The same refraction in minus cylinder; the axis of a sphere is 0.
SpheroCylinder to_sphero_cylinder(const PowerVector& refraction);

/// Moves a refraction by `distance_mm` along the direction of light (towards the eye positive): in each
/// meridian F' = F / (1 - d F). From the spectacle plane to the cornea distance_mm is the vertex distance,
/// back it is minus it.
PowerVector move_towards_eye(const PowerVector& refraction, double distance_mm);

}  // namespace emmetrope
