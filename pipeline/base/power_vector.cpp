#include "pipeline/base/power_vector.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope {

double distance_D(const PowerVector& a, const PowerVector& b) {
  return std::hypot(a.M_D - b.M_D, a.J0_D - b.J0_D, a.J45_D - b.J45_D);
}

PowerVector to_power_vector(const SpheroCylinder& refraction) {
  const double half_cylinder_D = refraction.cylinder_D / 2;
  const double twice_axis = 2 * refraction.axis_deg * degree;
  return {refraction.sphere_D + half_cylinder_D, -half_cylinder_D * std::cos(twice_axis),
          -half_cylinder_D * std::sin(twice_axis)};
}

SpheroCylinder to_sphero_cylinder(const PowerVector& refraction) {
  const double half_cylinder_D = std::hypot(refraction.J0_D, refraction.J45_D);
  if (half_cylinder_D == 0) return {refraction.M_D, 0, 0};
  const double axis_deg = 0.5 * std::atan2(refraction.J45_D, refraction.J0_D) / degree;
  return {refraction.M_D + half_cylinder_D, -2 * half_cylinder_D, normalise_axis_deg(axis_deg)};
}

PowerVector move_towards_eye(const PowerVector& refraction, double distance_mm) {
  // Dioptric power matrix (Long 1976); F' = (1 - d F)^-1 F acts on both principal meridians at once.
  Eigen::Matrix2d power;
  power << refraction.M_D + refraction.J0_D, refraction.J45_D, refraction.J45_D,
      refraction.M_D - refraction.J0_D;
  const Eigen::Matrix2d moved = (Eigen::Matrix2d::Identity() - distance_mm * 1e-3 * power).inverse() * power;
  return {(moved(0, 0) + moved(1, 1)) / 2, (moved(0, 0) - moved(1, 1)) / 2, (moved(0, 1) + moved(1, 0)) / 2};
}

}  // namespace emmetrope
