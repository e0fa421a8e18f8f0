#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "raytrace/device/device_meshes.hpp"
#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// A scene as kernels/scene.cl and kernels/meshes.cl take it.
struct DeviceScene {
  int channels = 1;  ///< 1: achromatic textures and background
  int plane_count = 0;
  std::vector<float> planes;
  std::vector<std::uint32_t> texels;
  std::vector<float> background;
  DeviceMeshes meshes;

  bool has_meshes() const { return meshes.node_count > 0; }
};

/// \param eye_from_scene  where the scene stands for a turned eye
/// \param monochromatic  luminances instead of colours
DeviceScene make_device_scene(const Scene& scene, const Eigen::Isometry3d& eye_from_scene, bool monochromatic,
                              int threads);

}  // namespace emmetrope::raytrace
