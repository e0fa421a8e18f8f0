#pragma once
#include <Eigen/Core>
#include <vector>

namespace emmetrope::segmentation {

/// An ellipsoid with one axis along a given direction and one horizontal.
struct EdgeEllipsoid {
  Eigen::Vector3d centre = {0, 0, 0};
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< columns: eye x, y, z (outward) in LPS
  Eigen::Vector3d half_axes = {12, 12, 12};
  double kept_share = 0;  ///< of the points, after trimming
  double rms_mm = 0;      ///< of the kept points' radial residuals
};

/// The ellipsoid along other axes through the same centre that has the same intercepts with them (mm): another surface, but of
/// a sphere. Residuals are those of the ellipsoid given.
EdgeEllipsoid along(const Eigen::Matrix3d& axes, const EdgeEllipsoid& ellipsoid);

/// Fits centre and half axes to points, with a soft-L1 loss of 0.3 mm and four rounds of trimming at 2.5 robust
/// standard deviations (at least 0.25 mm).
/// \param start  axes are kept
EdgeEllipsoid fit_ellipsoid(const std::vector<Eigen::Vector3d>& points, const EdgeEllipsoid& start);

}  // namespace emmetrope::segmentation
