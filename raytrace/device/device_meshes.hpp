#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// Meshes, materials and lights as kernels/meshes.cl takes them.
struct DeviceMeshes {
  std::vector<float> nodes, triangles, attributes, materials, lights;
  int node_count = 0, light_count = 0;
};

/// A scene's meshes with a hierarchy of bounding boxes over their triangles (binned surface area heuristic).
/// \param eye_from_scene  where the scene stands for a turned eye
/// \param channels  1: luminances
/// \param first_texel_of  stores a texture and returns the place of its first texel
DeviceMeshes make_device_meshes(const Scene& scene, const Eigen::Isometry3d& eye_from_scene, int channels,
                                const std::function<std::size_t(const Texture&)>& first_texel_of);

}  // namespace emmetrope::raytrace
