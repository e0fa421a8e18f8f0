#include "pipeline/python/bindings.hpp"
#include "raytrace/scene/scene.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::python {
namespace {

using namespace raytrace;

TraceSettings settings_of(const std::pair<int, int>& size, const std::pair<double, double>& field_mm,
                          const Eigen::Vector2d& centre_mm, int samples,
                          const std::optional<double>& wavelength_nm, std::uint64_t seed) {
  TraceSettings settings;
  settings.grid = {size.first, size.second, field_mm.first, field_mm.second, centre_mm};
  settings.samples = samples;
  settings.wavelength_nm = wavelength_nm;
  settings.seed = seed;
  settings.verbosity.quiet = true;
  return settings;
}

py::array_t<float> pixels_of(const TraceResult& result) {
  const LinearImage& image = result.image;
  py::array_t<float> pixels({image.height, image.width, image.channels});
  std::copy(image.values.begin(), image.values.end(), pixels.mutable_data());
  return pixels;
}

py::dict states_of(const TraceResult& result) {
  py::dict states;
  for (const auto& [state, count] : result.states) states[to_string(state)] = count;
  return states;
}

}  // namespace

void bind_pictures(py::module_& module) {
  py::class_<TraceResult>(module, "Picture", "What an eye sees.")
      .def_property_readonly("linear", &pixels_of,
                             "(height, width, 3) float32: linear light, upright as the patient perceives it.")
      .def_property_readonly("states", &states_of, "How many rays ended how.")
      .def_readonly("rays", &TraceResult::rays)
      .def_readonly("samples", &TraceResult::samples, "Rays a pixel.")
      .def_readonly("wall_s", &TraceResult::wall_s)
      .def_readonly("device", &TraceResult::device)
      .def(
          "write_png",
          [](const TraceResult& result, const std::string& file) { write_png(file, result.image); },
          py::arg("file"), "As sRGB.");
  py::class_<Tracer>(module, "Tracer", "OpenCL devices with their compiled kernels.")
      .def(py::init([](const std::string& device, int threads) { return Tracer(device, threads); }),
           py::arg("device") = "", py::arg("threads") = 0,
           "device: an index, a part of a name, or \"all\"; the first where it is empty.")
      .def_property_readonly("device_name", &Tracer::device_name)
      .def(
          "picture",
          [](const Tracer& tracer, const EyeModel& eye, const std::string& scene,
             const std::pair<int, int>& size, const std::pair<double, double>& field_mm,
             const Eigen::Vector2d& centre_mm, int samples, const std::optional<double>& wavelength_nm,
             std::uint64_t seed) {
            const TraceSettings settings =
                settings_of(size, field_mm, centre_mm, samples, wavelength_nm, seed);
            const py::gil_scoped_release unlocked;
            return tracer.trace(eye, *make_scene(scene), settings);
          },
          py::arg("eye"), py::arg("scene") = "letters", py::arg("size") = std::pair(500, 500),
          py::arg("field_mm") = std::pair(6.0, 6.0), py::arg("centre_mm") = Eigen::Vector2d(0, 0),
          py::arg("samples") = 128, py::arg("wavelength_nm") = py::none(), py::arg("seed") = 1,
          "The retinal image of a scene, a chart NAME[:key=value,...] or a scene.json.\n\n"
          "size: pixels (width, height); field_mm: on the retina; centre_mm: from the pole; samples: rays a pixel.");
}

}  // namespace emmetrope::python
