#include "correction/prescription/prescription.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/python/bindings.hpp"

namespace emmetrope::python {
namespace {

using namespace correction;

PrescriptionSettings settings_of(double vertex_distance_mm, double pupil_mm, const std::string& criterion,
                                 double wavelength_nm, const Eigen::Vector2d& retina_mm, std::uint64_t seed) {
  PrescriptionSettings settings;
  settings.criterion = criterion_from_string(criterion);
  settings.vertex_distance_mm = vertex_distance_mm;
  settings.pupil_mm = pupil_mm;
  settings.wavelength_nm = wavelength_nm;
  settings.fovea_mm = retina_mm;
  settings.seed = seed;
  settings.verbosity.quiet = true;
  settings.check();
  return settings;
}

py::object corrected(const raytrace::Tracer& tracer, const EyeModel& eye, double vertex_distance_mm,
                     double pupil_mm, const std::string& criterion, double wavelength_nm,
                     const Eigen::Vector2d& retina_mm, std::uint64_t seed) {
  const PrescriptionSettings settings =
      settings_of(vertex_distance_mm, pupil_mm, criterion, wavelength_nm, retina_mm, seed);
  Json json;
  {
    const py::gil_scoped_release unlocked;
    const Prescription prescription = prescribe(tracer, eye, settings);
    json = to_json(prescription, uncertainty_of(prescription, nullptr), "");
  }
  return to_python(json);
}

py::tuple sharpest(const raytrace::Tracer& tracer, const EyeModel& eye, double vertex_distance_mm,
                   double pupil_mm, const std::string& criterion, double wavelength_nm,
                   const Eigen::Vector2d& retina_mm, std::uint64_t seed) {
  const PrescriptionSettings settings =
      settings_of(vertex_distance_mm, pupil_mm, criterion, wavelength_nm, retina_mm, seed);
  const SearchResult found = [&] {
    const py::gil_scoped_release unlocked;
    return sharpest_lens(tracer, eye, settings);
  }();
  return py::make_tuple(found.family.power(found.best.lens), found.best.sharpness);
}

RetinalSharpness sharpness_of(const raytrace::Tracer& tracer, const EyeModel& eye, double vertex_distance_mm,
                              double pupil_mm, const std::string& criterion, double wavelength_nm,
                              const Eigen::Vector2d& retina_mm, std::uint64_t seed) {
  const PrescriptionSettings settings =
      settings_of(vertex_distance_mm, pupil_mm, criterion, wavelength_nm, retina_mm, seed);
  const ImagingLevel finest =
      imaging_levels(settings.criterion, pupil_mm, wavelength_nm, retina_mm, seed).back();
  return {tracer, judged_scene(eye, settings), eye, thin_lens(vertex_distance_mm), finest};
}

}  // namespace

void bind_corrections(py::module_& module) {
  const auto distance = py::arg("vertex_distance_mm") = 12.0;
  const auto pupil = py::arg("pupil_mm") = 3.0;
  const auto criterion = py::arg("criterion") = "gradient-energy";
  const auto wavelength = py::arg("wavelength_nm") = 589.3;
  const auto retina = py::arg("retina_mm") = Eigen::Vector2d(0, 0);
  const auto seed = py::arg("seed") = 1;
  module.def(
      "correct", &corrected, py::arg("tracer"), py::arg("eye"), distance, pupil, criterion, wavelength,
      retina, seed,
      "The lens that makes the retinal image of an eye sharpest, as a dictionary: what prescription.json holds, "
      "but for what_if.\n\n"
      "criterion: gradient-energy, laplacian-variance or mtf-weighted; retina_mm: eye x, y from the pole.");
  module.def("sharpest_lens", &sharpest, py::arg("tracer"), py::arg("eye"), distance, pupil, criterion,
             wavelength, retina, seed,
             "The search of correct() alone: (PowerVector at the vertex distance, sharpness behind it).");
  py::class_<RetinalSharpness>(
      module, "Sharpness",
      "Sharpness of the retinal image behind a thin lens, as correct() judges it at last: the "
      "energy of its detail over that through a pinhole. A smooth function with derivatives: "
      "the same rays serve every lens. Not for several threads at once.")
      .def(py::init(&sharpness_of), py::arg("tracer"), py::arg("eye"), distance, pupil, criterion, wavelength,
           retina, seed, py::keep_alive<1, 2>())
      .def(
          "__call__",
          [](const RetinalSharpness& sharpness, const Eigen::Vector3d& lens_D) {
            if (!lens_D.allFinite()) throw usage_error("lens_D: three finite numbers are wanted");
            const SharpnessValue value = [&] {
              const py::gil_scoped_release unlocked;
              return sharpness(lens_D);
            }();
            return py::make_tuple(value.value, value.gradient);
          },
          py::arg("lens_D"), "lens_D: M, J0, J45 (3,). Returns (sharpness, its gradient (3,), 1/D).")
      .def_property_readonly("images", &RetinalSharpness::images, "Retinal images traced until now.");
}

}  // namespace emmetrope::python
