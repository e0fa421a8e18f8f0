#pragma once
#include "segmentation/fit/eye_fit.hpp"

namespace emmetrope::segmentation {

/// The distances of an eye that images measure.
enum Distance : int {
  pole_depth,  ///< apex to interface along the axis, displacement included
  chamber_depth,
  lens_depth,    ///< thickness of the lens
  globe_width,   ///< extent of the interface along x, displacement included
  globe_height,  ///< along y
  distance_count
};

/// Their derivatives by the free parameters (rows, in the order of fit.active).
Eigen::MatrixXd distance_derivatives(const EyeFit& fit);

}  // namespace emmetrope::segmentation
