#pragma once
#include <functional>
#include <vector>

#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// Six square pictures at infinity that enclose the eye.
/// \param texels    of a side, 90 degrees
/// \param light_of  linear light, a value a channel, that comes from a direction (unit, towards the scene; the eye's
///   frame before gaze)
std::vector<TexturedPlane> surround(
    int texels, int channels,
    const std::function<void(const Eigen::Vector3d& direction, float* light)>& light_of);

/// An equirectangular picture, twice as wide as high, all round at infinity: its middle straight ahead, its right
/// half on the patient's right, its top row overhead.
std::vector<TexturedPlane> panorama(const Texture& picture);

/// A perimeter bowl at infinity: circles every 10 degrees from straight ahead (bold every 30), spokes every 30
/// degrees, and quadrants of different greys, the darkest up and to the patient's right.
Scene perimeter();

}  // namespace emmetrope::raytrace
