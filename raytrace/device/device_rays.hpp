#pragma once
#include <string>
#include <vector>

#include "raytrace/device/device_scene.hpp"
#include "raytrace/device/opencl.hpp"
#include "raytrace/system/optical_system.hpp"

namespace emmetrope::raytrace {

/// Sets a kernel's arguments one after the other.
class Arguments {
 public:
  explicit Arguments(cl::Kernel& kernel) : kernel_(kernel) {}
  template <typename... Values>
  void add(const Values&... values) {
    (kernel_.setArg(place_++, values), ...);
  }
  cl_uint place() const { return place_; }

 private:
  cl::Kernel& kernel_;
  cl_uint place_ = 0;
};

/// The buffers of an optical system: SYSTEM in kernels/trace.cl.
struct SystemBuffers {
  SystemBuffers(const OpenCl& cl, const OpticalSystem& system);
  void add_to(Arguments& arguments) const { arguments.add(kinds, operations, ratios, gradients, records); }
  cl::Buffer kinds, operations, ratios, gradients, records;
};

/// The buffers of a scene, which outlives them: SCENE in kernels/scene.cl.
struct SceneBuffers {
  SceneBuffers(const OpenCl& cl, const DeviceScene& scene);
  void add_to(Arguments& arguments) const {
    arguments.add(planes, plane_count, texels, background);
    if (node_count > 0)
      arguments.add(nodes, node_count, triangles, attributes, materials, lights, light_count);
  }
  cl::Buffer planes, texels, background, nodes, triangles, attributes, materials, lights;
  cl_int plane_count, node_count, light_count;
};

/// What the kernels are compiled for, beside the optical system.
struct KernelForm {
  int lanes = 1, in_flight = 1, channels = 1, waves = 1;
  bool spectral = false, illuminance = false, random_cap = false, meshes = false, tile = false,
       stiles_crawford = false, diffraction = false;
  std::size_t tangents = 0;
  std::string more;  ///< further definitions
};
std::string definitions_of(const OpticalSystem& system, const KernelForm& form);

constexpr int work_group = 64;  ///< pixels, or rays

/// Single rays through the first operations of a system: x, y, z, L, M, N as planes of `count` values in; the
/// same behind them out, and a seventh plane with the state (kernels/surfaces.cl).
/// \pre the system's wavelengths are one and the same
/// \throw cl::Error
std::vector<float> trace_rays(OpenCl& cl, const OpticalSystem& system, const SystemBuffers& buffers,
                              const std::vector<float>& in, int operation_count);

}  // namespace emmetrope::raytrace
