#pragma once
#include <Eigen/Core>
#include <vector>

#include "raytrace/retina/pupil_aim.hpp"

namespace emmetrope::raytrace {

/// What maps from (retina point, place in the pupil) are made of: polynomials of the place in the unit disc
/// that the aim ellipse stands for, whose coefficients are interpolated over the field between Chebyshev
/// nodes.

/// Points of the unit disc, denser towards its rim, so that least squares come close to the least maximum.
std::vector<Eigen::Vector2d> disc_points(int rings, int spokes);

/// x^i y^j with i + j <= degree, i rising, for j = 0 ... degree, as the kernels take them.
Eigen::VectorXd powers(const Eigen::Vector2d& p, int degree);

/// On [-1, 1].
std::vector<double> chebyshev_nodes(int count);

/// The tile that holds a place of the field in 0..1, and the weights of its nodes there.
struct Place {
  int tile = 0;
  Eigen::VectorXd weights;
};
Place place_of(double share, int nodes, int tiles);

/// The retina point of a share (0..1) of the field, eye x and y in mm.
Eigen::Vector2d field_point(const RetinalGrid& grid, double share_x, double share_y);

/// The ray from the retina to a place of the disc.
Ray aimed_ray(const Eigen::Vector3d& retina, double plane_z_mm, const AimEllipse& ellipse,
              const Eigen::Vector2d& disc);

}  // namespace emmetrope::raytrace
