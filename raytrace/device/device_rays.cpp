#include "raytrace/device/device_rays.hpp"

namespace emmetrope::raytrace {

SystemBuffers::SystemBuffers(const OpenCl& cl, const OpticalSystem& system)
    : kinds(cl.upload(system.kinds)),
      operations(cl.upload(system.operations)),
      ratios(cl.upload(system.ratios)),
      gradients(cl.upload(system.gradients)),
      records(cl.upload(system.records)) {}

SceneBuffers::SceneBuffers(const OpenCl& cl, const DeviceScene& scene)
    : planes(cl.upload(scene.planes)),
      texels(cl.share(scene.texels)),
      background(cl.upload(scene.background)),
      nodes(cl.upload(scene.meshes.nodes)),
      triangles(cl.upload(scene.meshes.triangles)),
      attributes(cl.upload(scene.meshes.attributes)),
      materials(cl.upload(scene.meshes.materials)),
      lights(cl.upload(scene.meshes.lights)),
      plane_count(scene.plane_count),
      node_count(scene.meshes.node_count),
      light_count(scene.meshes.light_count) {}

std::string definitions_of(const OpticalSystem& system, const KernelForm& form) {
  std::string text;
  const auto define = [&](const char* name, std::size_t value) {
    text += std::string(" -D") + name + "=" + std::to_string(value);
  };
  define("VLN", form.lanes);
  define("UN", form.in_flight);
  define("CHANNELS", form.channels);
  define("SPECTRAL", form.spectral ? 1 : 0);
  define("WAVES", form.waves);
  define("ILLUMINANCE", form.illuminance ? 1 : 0);
  define("TANGENTS", form.tangents);
  define("RANDOM_CAP", form.random_cap ? 1 : 0);
  define("STILES_CRAWFORD", form.stiles_crawford ? 1 : 0);
  define("DIFFRACTION", form.diffraction ? 1 : 0);
  define("HAS_MESHES", form.meshes ? 1 : 0);
  define("TILE", form.tile ? 1 : 0);
  return text.substr(1) + form.more + system.definitions();
}

std::vector<float> trace_rays(OpenCl& cl, const OpticalSystem& system, const SystemBuffers& buffers,
                              const std::vector<float>& in, int operation_count) {
  const std::size_t given = in.size() / 6, count = (given + 15) / 16 * 16;
  std::vector<float> padded(6 * count), out(7 * count);
  for (std::size_t plane = 0; plane < 6; ++plane)
    for (std::size_t i = 0; i < count && given > 0; ++i)
      padded[plane * count + i] = in[plane * given + std::min(i, given - 1)];
  KernelForm form;
  form.lanes = cl.lanes();
  cl::Kernel kernel(cl.program(definitions_of(system, form)), "trace_rays");
  const cl::Buffer in_buffer = cl.upload(padded), out_buffer = cl.allocate(out.size() * sizeof(float));
  Arguments arguments(kernel);
  buffers.add_to(arguments);
  arguments.add(cl_int{operation_count}, static_cast<cl_int>(count), cl_int{0}, in_buffer, out_buffer);
  const std::size_t items = count / cl.lanes();
  cl.queue().enqueueNDRangeKernel(kernel, cl::NullRange,
                                  cl::NDRange((items + work_group - 1) / work_group * work_group),
                                  cl::NDRange(work_group));
  cl.queue().enqueueReadBuffer(out_buffer, CL_TRUE, 0, out.size() * sizeof(float), out.data());
  std::vector<float> result(7 * given);
  for (std::size_t plane = 0; plane < 7; ++plane)
    std::copy_n(out.begin() + static_cast<std::ptrdiff_t>(plane * count), given,
                result.begin() + static_cast<std::ptrdiff_t>(plane * given));
  return result;
}

}  // namespace emmetrope::raytrace
