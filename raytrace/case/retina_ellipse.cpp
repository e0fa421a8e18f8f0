#include "raytrace/case/retina_ellipse.hpp"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <limits>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"

namespace emmetrope::raytrace {
namespace {

/// Root of chi2 with two degrees of freedom that 95 % stay below.
const double sigmas_of_95 = std::sqrt(-2 * std::log(0.05));

/// Two directions along the retina at a point: away from the pole, and across it.
using Along = Eigen::Matrix<double, 3, 2>;

Along along_retina(const RetinaPoint& point) {
  const Eigen::Vector2d beside = point.position_mm.head<2>();
  const Eigen::Vector3d outward =
      beside.norm() > 1e-6 ? Eigen::Vector3d(beside.x(), beside.y(), 0) : Eigen::Vector3d::UnitX();
  Along along;
  // In the plane of the axis: what of the normal's quarter turn about the meridian's plane is tangential.
  const Eigen::Vector3d across = point.normal.cross(outward).normalized();
  along.col(0) = across.cross(point.normal);
  along.col(1) = across;
  return along;
}

RetinaEllipse ellipse_of(const Eigen::Matrix2d& covariance_mm2) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance_mm2);
  const Eigen::Vector2d longer = axes.eigenvectors().col(1);
  const double angle_deg = std::atan2(longer.y(), longer.x()) / degree;
  return {sigmas_of_95 * axes.eigenvalues().reverse().cwiseMax(0).cwiseSqrt(),
          angle_deg < 0 ? angle_deg + 180 : angle_deg};
}

}  // namespace

std::vector<std::optional<RetinaEllipse>> retina_ellipses(
    const UncertainOptics& optics, const std::function<EyeModel(const EyeModel&)>& as_it_looks,
    const std::vector<Eigen::Vector3d>& directions, double wavelength_nm, int threads) {
  const std::size_t count = directions.size();
  const NormalDistribution known = optics.known.parameters();
  const auto seen_by = [&](const Eigen::VectorXd& values) {
    const EyeModel eye = as_it_looks(eye_at(optics, values));
    const ChiefRays chief_rays(eye, wavelength_nm);
    std::vector<std::optional<RetinaPoint>> points(count);
    on_threads(threads, count, [&](std::size_t k) { points[k] = chief_rays.image_of(directions[k]); });
    // Places are those on the retina, which moves as a whole with the eye's length.
    for (auto& point : points)
      if (point) point->position_mm.z() += eye.axial_length_mm();
    return points;
  };
  const std::vector<std::optional<RetinaPoint>> means = seen_by(known.mean);
  const Eigen::MatrixXd slopes = jacobian(known, [&](const Eigen::VectorXd& values) {
    const std::vector<std::optional<RetinaPoint>> points = seen_by(values);
    Eigen::VectorXd places = Eigen::VectorXd::Constant(2 * static_cast<Eigen::Index>(count),
                                                       std::numeric_limits<double>::quiet_NaN());
    for (std::size_t k = 0; k < count; ++k)
      if (points[k] && means[k])
        places.segment<2>(2 * static_cast<Eigen::Index>(k)) =
            along_retina(*means[k]).transpose() * (points[k]->position_mm - means[k]->position_mm);
    return places;
  });
  std::vector<std::optional<RetinaEllipse>> ellipses(count);
  for (std::size_t k = 0; k < count; ++k) {
    const auto of_place = slopes.middleRows<2>(2 * static_cast<Eigen::Index>(k));
    if (of_place.allFinite()) ellipses[k] = ellipse_of(of_place * known.covariance * of_place.transpose());
  }
  return ellipses;
}

}  // namespace emmetrope::raytrace
