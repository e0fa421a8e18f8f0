#include "segmentation/fit/eye_distances.hpp"

#include <algorithm>

namespace emmetrope::segmentation {

using Eigen::MatrixXd;
using Eigen::Vector3d;

MatrixXd distance_derivatives(const EyeFit& fit) {
  MatrixXd derivatives = MatrixXd::Zero(static_cast<Eigen::Index>(fit.active.size()), distance_count);
  const auto add = [&](Distance distance, int parameter, double derivative) {
    const auto at = std::find(fit.active.begin(), fit.active.end(), parameter);
    if (at != fit.active.end()) derivatives(at - fit.active.begin(), distance) += derivative;
  };
  const std::vector<Vector3d> bumps = bump_directions();
  const auto add_displacement = [&](Distance distance, const Vector3d& direction, int half_axis) {
    for (int i = 0; i < fit.layout.bumps; ++i)
      add(distance, fit.layout.displacement() + i,
          fit.value(half_axis) / displacement_sphere_mm * bump_at(direction.dot(bumps[i])).value);
  };
  add(pole_depth, axial_length, 1);
  add_displacement(pole_depth, -Vector3d::UnitZ(), globe_z);
  add(chamber_depth, anterior_chamber_depth, 1);
  add(lens_depth, lens_thickness, 1);
  for (const double side : {-1.0, 1.0}) {
    add(globe_width, globe_x, 1);
    add_displacement(globe_width, side * Vector3d::UnitX(), globe_x);
    add(globe_height, globe_y, 1);
    add_displacement(globe_height, side * Vector3d::UnitY(), globe_y);
  }
  return derivatives;
}

}  // namespace emmetrope::segmentation
