#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/base/frames.hpp"

/// Points spread evenly.
namespace emmetrope {

inline double golden_angle_rad() { return pi * (3 - std::sqrt(5.0)); }

/// Direction i of `count` over the unit sphere, from +z to -z: a Fibonacci lattice.
inline Eigen::Vector3d fibonacci_direction(int i, int count) {
  const double z = 1 - (2.0 * i + 1) / count, r = std::sqrt(1 - z * z), angle = golden_angle_rad() * i;
  return {r * std::cos(angle), r * std::sin(angle), z};
}

/// About `count` directions over the unit sphere, in rings about z, the same ones mirrored in x, in y or in z: what is
/// sampled along them does not turn a mirrored head into another one.
inline std::vector<Eigen::Vector3d> mirrored_directions(int count) {
  const double area = 4 * pi / count;
  const int rings = static_cast<int>(std::lround(pi / std::sqrt(area)));
  const double step = pi / rings;
  std::vector<Eigen::Vector3d> directions;
  for (int ring = 0; ring <= rings; ++ring) {
    const double polar = ring * step, r = std::sin(polar);
    const bool is_pole = ring == 0 || ring == rings;
    const int in_ring = is_pole ? 1 : 2 * static_cast<int>(std::lround(pi * r * step / area));
    const double first = std::min(ring, rings - ring) % 2 == 0 ? 0 : 0.5;
    for (int i = 0; i < in_ring; ++i) {
      const double angle = 2 * pi * (i + first) / in_ring;
      directions.emplace_back(r * std::cos(angle), r * std::sin(angle), std::cos(polar));
    }
  }
  return directions;
}

/// Point i of `count` over the unit disc, from the middle outward: a sunflower.
inline Eigen::Vector2d sunflower_point(int i, int count) {
  const double r = std::sqrt((i + 0.5) / count), angle = golden_angle_rad() * i;
  return {r * std::cos(angle), r * std::sin(angle)};
}

}  // namespace emmetrope
