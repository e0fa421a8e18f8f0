#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <random>

#include "data_samples/phantom/acquisition.hpp"

namespace emmetrope::phantom {

/// The head's rigid movement between the first stack and this one, about a pivot (LPS, mm); none for the
/// first stack. The same seed and stack give the same movement.
Eigen::Isometry3d stack_movement(const Eigen::Vector3d& pivot, const Disturbances& disturbances,
                                 std::size_t stack);

/// The further shift of one slice.
Eigen::Isometry3d slice_movement(const Disturbances& disturbances, std::mt19937_64& random);

/// Random numbers of one slice, its movement's first, then its noise: independent of the order of rendering.
std::mt19937_64 slice_random(std::uint64_t seed, std::size_t stack, int slice);

}  // namespace emmetrope::phantom
