#include "segmentation/edges/edge_ellipsoid.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>

#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Distance of a point from the ellipsoid along the ray from its centre.
struct RadialDistance {
  Vector3d point;
  Eigen::Matrix3d eye_from_lps;

  template <typename T>
  bool operator()(const T* centre, const T* half_axes, T* residual) const {
    const Eigen::Matrix<T, 3, 1> from_centre =
        eye_from_lps.cast<T>() * (point.cast<T>() - Eigen::Map<const Eigen::Matrix<T, 3, 1>>(centre));
    const Eigen::Matrix<T, 3, 1> scaled =
        from_centre.cwiseQuotient(Eigen::Map<const Eigen::Matrix<T, 3, 1>>(half_axes));
    residual[0] = from_centre.norm() * (T(1) - T(1) / scaled.norm());
    return true;
  }
};

void solve(EdgeEllipsoid& ellipsoid, const std::vector<Vector3d>& points) {
  ceres::Problem problem;
  for (const Vector3d& point : points)
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<RadialDistance, 1, 3, 3>(
                                 new RadialDistance{point, ellipsoid.axes.transpose()}),
                             new ceres::SoftLOneLoss(0.3), ellipsoid.centre.data(),
                             ellipsoid.half_axes.data());
  for (int i = 0; i < 3; ++i) {
    problem.SetParameterLowerBound(ellipsoid.half_axes.data(), i, 6);
    problem.SetParameterUpperBound(ellipsoid.half_axes.data(), i, 20);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.logging_type = ceres::SILENT;
  options.max_num_iterations = 60;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-10;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
}

}  // namespace

EdgeEllipsoid along(const Eigen::Matrix3d& axes, const EdgeEllipsoid& ellipsoid) {
  EdgeEllipsoid turned = ellipsoid;
  turned.axes = axes;
  for (int i = 0; i < 3; ++i)
    turned.half_axes[i] =
        1 / Vector3d(ellipsoid.axes.transpose() * axes.col(i)).cwiseQuotient(ellipsoid.half_axes).norm();
  return turned;
}

EdgeEllipsoid fit_ellipsoid(const std::vector<Vector3d>& points, const EdgeEllipsoid& start) {
  EdgeEllipsoid ellipsoid = start;
  std::vector<Vector3d> kept = points;
  for (int round = 0; round < 4; ++round) {
    if (kept.size() < 50) {
      ellipsoid.kept_share = 0;
      return ellipsoid;
    }
    solve(ellipsoid, kept);
    std::vector<double> residuals;
    for (const Vector3d& point : points) {
      double residual = 0;
      RadialDistance{point, ellipsoid.axes.transpose()}(ellipsoid.centre.data(), ellipsoid.half_axes.data(),
                                                        &residual);
      residuals.push_back(std::abs(residual));
    }
    std::vector<double> sorted = residuals;
    const double limit = std::max(0.25, 2.5 * 1.4826 * quantile(sorted, 0.5));
    kept.clear();
    double squares = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (residuals[i] < limit) {
        kept.push_back(points[i]);
        squares += residuals[i] * residuals[i];
      }
    ellipsoid.kept_share = static_cast<double>(kept.size()) / static_cast<double>(points.size());
    ellipsoid.rms_mm = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(kept.size(), 1)));
  }
  return ellipsoid;
}

}  // namespace emmetrope::segmentation
