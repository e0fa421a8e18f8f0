#include "pipeline/base/astigmatism.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope {

Astigmatism astigmatism_of(const Eigen::Vector2d& j_D, const Eigen::Matrix3d& covariance) {
  constexpr double normal_95 = 1.959963985;
  const Eigen::Matrix2d of_j = covariance.block<2, 2>(1, 1);
  Astigmatism result;
  result.half_cylinder_D = j_D.norm();
  // Direction of the astigmatism; where there is none, the direction in which it is known least.
  Eigen::Vector2d along = j_D / result.half_cylinder_D;
  if (!(result.half_cylinder_D > 1e-9))
    along = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(of_j).eigenvectors().col(1);
  const Eigen::Vector2d across(-along.y(), along.x());
  result.sigma_half_cylinder_D = std::sqrt(std::max(0.0, along.dot(of_j * along)));
  result.covariance_with_M_D2 = along.dot(covariance.block<2, 1>(1, 0));
  result.axis_deg = normalise_axis_deg(std::atan2(j_D.y(), j_D.x()) / degree / 2);
  const double sigma_across_D = std::sqrt(std::max(0.0, across.dot(of_j * across)));
  const bool may_be_none = result.half_cylinder_D <= normal_95 * result.sigma_half_cylinder_D;
  result.axis_half_width_deg =
      may_be_none || result.half_cylinder_D == 0
          ? 90
          : std::min(90.0, normal_95 * sigma_across_D / (2 * result.half_cylinder_D) / degree);
  return result;
}

std::string astigmatism_type(double steep_axis_deg) {
  const double from_vertical = std::abs(normalise_axis_deg(steep_axis_deg) - 90);
  if (from_vertical <= 30) return "with-the-rule";
  return from_vertical >= 60 ? "against-the-rule" : "oblique";
}

}  // namespace emmetrope
