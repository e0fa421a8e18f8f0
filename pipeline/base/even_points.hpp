#pragma once
#include <Eigen/Core>
#include <cmath>

#include "pipeline/base/frames.hpp"

/// Points spread evenly by the golden angle.
namespace emmetrope {

inline double golden_angle_rad() { return pi * (3 - std::sqrt(5.0)); }

/// Direction i of `count` over the unit sphere, from +z to -z: a Fibonacci lattice.
inline Eigen::Vector3d fibonacci_direction(int i, int count) {
  const double z = 1 - (2.0 * i + 1) / count, r = std::sqrt(1 - z * z), angle = golden_angle_rad() * i;
  return {r * std::cos(angle), r * std::sin(angle), z};
}

/// Point i of `count` over the unit disc, from the middle outward: a sunflower.
inline Eigen::Vector2d sunflower_point(int i, int count) {
  const double r = std::sqrt((i + 0.5) / count), angle = golden_angle_rad() * i;
  return {r * std::cos(angle), r * std::sin(angle)};
}

}  // namespace emmetrope
