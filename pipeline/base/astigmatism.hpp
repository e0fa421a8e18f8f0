#pragma once
#include <Eigen/Core>
#include <string>

namespace emmetrope {

/// The astigmatism of a power vector (M, J0, J45) with its uncertainty, by linear propagation: half the
/// cylinder is the length of J, the axis half its direction.
struct Astigmatism {
  double half_cylinder_D = 0;
  double sigma_half_cylinder_D = 0;
  double covariance_with_M_D2 = 0;  ///< of half the cylinder
  double axis_deg = 0;              ///< minus cylinder of a refraction, flat meridian of a cornea
  double axis_half_width_deg = 0;   ///< of the 95 % interval; 90, all there is, where the cylinder's holds 0
};

/// \param covariance  of (M, J0, J45)
Astigmatism astigmatism_of(const Eigen::Vector2d& j_D, const Eigen::Matrix3d& covariance);

/// "with-the-rule" (steep meridian within 30 degrees of the vertical), "against-the-rule" (within 30 of the
/// horizontal) or "oblique".
std::string astigmatism_type(double steep_axis_deg);

}  // namespace emmetrope
