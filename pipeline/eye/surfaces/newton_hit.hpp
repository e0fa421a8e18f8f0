#pragma once
#include <cmath>
#include <optional>

#include "pipeline/eye/surfaces/shape.hpp"

namespace emmetrope {

/// A depth behind the vertex plane with its slope.
struct Sag {
  double depth_mm = 0;
  Eigen::Vector2d slope{0, 0};
};

/// The surface is z + d(x, y) = 0: slope of the depth to the unit normal with positive z.
inline Eigen::Vector3d normal_from_slope(const Eigen::Vector2d& slope) {
  return Eigen::Vector3d(slope.x(), slope.y(), 1).normalized();
}

/// Newton's method for the hit of a ray with a surface known by its depth, from distance `t`.
/// \param sag_at  (x, y) -> std::optional<Sag>; a step that leaves the surface's reach is halved
template <typename SagAt>
std::optional<ShapeHit> newton_hit(const Ray& ray, double t, const SagAt& sag_at) {
  const Eigen::Vector2d o = ray.origin.head<2>(), v = ray.direction.head<2>();
  std::optional<Sag> sag = sag_at(Eigen::Vector2d(o + t * v));
  if (!sag) return std::nullopt;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const double error = -ray.origin.z() - t * ray.direction.z() - sag->depth_mm;
    const double rate = -ray.direction.z() - sag->slope.dot(v);
    if (rate == 0) return std::nullopt;
    double step = -error / rate;
    std::optional<Sag> next = sag_at(Eigen::Vector2d(o + (t + step) * v));
    for (int k = 0; !next && k < 30; ++k) {
      step /= 2;
      next = sag_at(Eigen::Vector2d(o + (t + step) * v));
    }
    if (!next) return std::nullopt;
    t += step;
    sag = next;
    if (std::abs(step) > 1e-13 * (1 + std::abs(t))) continue;
    const Eigen::Vector3d position = ray.origin + t * ray.direction;
    if (std::abs(-position.z() - sag->depth_mm) > 1e-10) return std::nullopt;
    return ShapeHit{t, position, normal_from_slope(sag->slope)};
  }
  return std::nullopt;
}

/// Distances from which Newton's method is worth a try: the hits with the osculating sphere and with the
/// vertex plane.
std::vector<double> newton_starts(const Ray& ray, double mean_curvature_per_mm);

}  // namespace emmetrope
