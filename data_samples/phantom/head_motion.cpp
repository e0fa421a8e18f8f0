#include "data_samples/phantom/head_motion.hpp"

#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

std::uint64_t mixed(std::uint64_t seed, std::uint64_t salt) {  // splitmix64
  std::uint64_t z = seed + 0x9E3779B97F4A7C15ULL * (salt + 1);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}

Vector3d gaussian_vector(std::mt19937_64& random, double sigma) {
  std::normal_distribution<double> normal(0, 1);
  const double x = normal(random);
  const double y = normal(random);
  return sigma * Vector3d(x, y, normal(random));
}

}  // namespace

Isometry3d stack_movement(const Vector3d& pivot, const Disturbances& disturbances, std::size_t stack) {
  if (stack == 0) return Isometry3d::Identity();
  std::mt19937_64 random(mixed(disturbances.seed, 1000 + stack));
  const Vector3d shift = gaussian_vector(random, disturbances.motion_mm);
  const Vector3d turn = gaussian_vector(random, disturbances.motion_deg * degree);
  const double angle = turn.norm();
  const Eigen::AngleAxisd rotation(angle, angle > 0 ? Vector3d(turn / angle) : Vector3d::UnitX());
  return Eigen::Translation3d(pivot + shift) * rotation * Eigen::Translation3d(-pivot);
}

Isometry3d slice_movement(const Disturbances& disturbances, std::mt19937_64& random) {
  return Isometry3d(Eigen::Translation3d(gaussian_vector(random, disturbances.slice_motion_mm)));
}

std::mt19937_64 slice_random(std::uint64_t seed, std::size_t stack, int slice) {
  return std::mt19937_64(mixed(seed, 1000000 * (stack + 1) + slice));
}

}  // namespace emmetrope::phantom
