#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <memory>

#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::correction {

/// The scene on which sharpness is judged: a random texture at infinity that has as much detail in every
/// direction, at every place and at every scale as a picture full of edges (power falling as the third power
/// of frequency), from 0.1 to 25 cycles per degree. Unlike a chart of letters or bars it is band-limited, so
/// that its image is a smooth function of the lens, and no repeated form can be mistaken for itself when it
/// is blurred (spurious resolution).
/// \param towards  from the eye to its middle, eye frame, z > 0: it stands upright across that direction
/// \param extent_deg  width and height
std::shared_ptr<const raytrace::Scene> refraction_chart(
    const Eigen::Vector3d& towards = Eigen::Vector3d::UnitZ(), double extent_deg = 17,
    std::uint64_t seed = 1);

/// What stands straight ahead, upright across another direction of the eye's frame, z > 0.
raytrace::TexturedPlane turned_towards(const Eigen::Vector3d& direction, raytrace::TexturedPlane plane);

}  // namespace emmetrope::correction
