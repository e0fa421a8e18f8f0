#pragma once
#include <Eigen/Core>

namespace emmetrope::phantom {

/// Distance from an ellipsoid about the origin to first order, good near its surface; negative inside.
inline double ellipsoid_distance(const Eigen::Vector3d& p, const Eigen::Vector3d& half_axes) {
  const Eigen::Vector3d scaled = p.cwiseQuotient(half_axes);
  const double k0 = scaled.norm();
  const double k1 = scaled.cwiseQuotient(half_axes).norm();
  return k1 > 0 ? k0 * (k0 - 1) / k1 : -half_axes.minCoeff();
}

}  // namespace emmetrope::phantom
