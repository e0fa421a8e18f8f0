#include "pipeline/follow/quantities.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/parametric/retinal_metrics.hpp"

namespace emmetrope::follow {

using Eigen::Index;
using Eigen::VectorXd;

const std::vector<FollowedQuantity>& followed_quantities() {
  static const std::vector<FollowedQuantity> list{{"axial_length_mm", "Axial length", "mm", 2},
                                                  {"vitreous_depth_mm", "Vitreous depth", "mm", 2},
                                                  {"anterior_chamber_depth_mm", "Anterior chamber", "mm", 2},
                                                  {"lens_thickness_mm", "Lens thickness", "mm", 2},
                                                  {"globe_width_mm", "Globe, width", "mm", 2},
                                                  {"globe_height_mm", "Globe, height", "mm", 2},
                                                  {"corneal_power_D", "Corneal power, mean", "D", 2, true}};
  return list;
}

VectorXd quantities_of(const ParametricEye& eye) {
  const InterfaceDistance interface = vitreoretinal_interface(eye);
  const LensOnAxis lens = lens_on_axis(eye);
  VectorXd values(static_cast<Index>(followed_quantities().size()));
  values << eye.pole_depth_mm(), eye.pole_depth_mm() - lens.back_mm, lens.front_mm,
      lens.back_mm - lens.front_mm, globe_extent_mm(interface, Eigen::Vector3d::UnitX()),
      globe_extent_mm(interface, Eigen::Vector3d::UnitY()), corneal_power(anterior_cornea(eye)).M_D;
  return values;
}

namespace {

/// d quantity / d parameter at the mean of the visits.
Eigen::MatrixXd slopes_of(const Growth& growth) {
  VectorXd at(growth.per_year.mean.size());
  for (Index i = 0; i < at.size(); ++i)
    at[i] = growth.eye.get(growth.parameters[static_cast<std::size_t>(i)]);
  return jacobian({at, growth.per_year.covariance}, [&](const VectorXd& values) {
    ParametricEye eye = growth.eye;
    for (Index i = 0; i < values.size(); ++i)
      eye.set(growth.parameters[static_cast<std::size_t>(i)], values[i]);
    return quantities_of(eye);
  });
}

}  // namespace

std::vector<Measured> growth_of_quantities(const Growth& growth) {
  const Eigen::MatrixXd slopes = slopes_of(growth);
  const VectorXd value = slopes * growth.per_year.mean;
  const Eigen::MatrixXd covariance = slopes * growth.per_year.covariance * slopes.transpose();
  VectorXd expected_sigma(growth.per_year.mean.size());
  for (Index i = 0; i < expected_sigma.size(); ++i)
    expected_sigma[i] = change_sigma(growth.parameters[static_cast<std::size_t>(i)]);
  const VectorXd expected_variance = (slopes * expected_sigma.asDiagonal()).rowwise().squaredNorm();
  std::vector<Measured> quantities;
  for (Index i = 0; i < value.size(); ++i) {
    const double share = std::clamp(1 - covariance(i, i) / expected_variance[i], 0.0, 1.0);
    quantities.push_back(
        Measured::from_sigma(value[i], std::sqrt(covariance(i, i)), Origin::of_images("mri", share), "fit"));
  }
  return quantities;
}

std::vector<std::vector<Difference>> differences_of_quantities(const Growth& growth) {
  const Eigen::MatrixXd slopes = slopes_of(growth);
  std::vector<std::vector<Difference>> visits;
  for (const NormalDistribution& difference : growth.differences) {
    const VectorXd value = slopes * difference.mean;
    const Eigen::MatrixXd covariance = slopes * difference.covariance * slopes.transpose();
    std::vector<Difference>& quantities = visits.emplace_back();
    for (Index i = 0; i < value.size(); ++i) quantities.push_back({value[i], std::sqrt(covariance(i, i))});
  }
  return visits;
}

}  // namespace emmetrope::follow
