#include "pipeline/eye/population/limits.hpp"
#include "pipeline/python/bindings.hpp"
#include "raytrace/wavefront/field.hpp"

namespace emmetrope::python {
namespace {

using namespace raytrace;

py::array_t<double> array_of(const std::vector<double>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

Wavefront wavefront_of(const EyeModel& eye, const Eigen::Vector2d& retina_mm,
                       const std::optional<double>& wavelength_nm, int order, double stiles_crawford_per_mm2,
                       const std::optional<double>& entrance_pupil_mm) {
  WavefrontSettings settings;
  settings.fovea_mm = retina_mm;
  settings.wavelength_nm = wavelength_of(eye, wavelength_nm);
  settings.order = order;
  settings.stiles_crawford_per_mm2 = stiles_crawford_per_mm2;
  settings.entrance_pupil_mm = entrance_pupil_mm;
  const py::gil_scoped_release unlocked;
  return measure_wavefront(eye, settings);
}

py::tuple spread_of(const Wavefront& wavefront, const PowerVector& lens_in_pupil) {
  const PointSpread spread = [&] {
    const py::gil_scoped_release unlocked;
    return point_spread(wavefront, lens_in_pupil);
  }();
  py::array_t<float> values({spread.size, spread.size});
  std::copy(spread.values.begin(), spread.values.end(), values.mutable_data());
  return py::make_tuple(values, spread.pitch_arcmin, spread.wraps);
}

void field_into(const EyeModel& eye, const std::string& folder, double reach_deg, double step_deg,
                const std::optional<double>& wavelength_nm, double stiles_crawford_per_mm2, int threads) {
  const FieldGrid grid{reach_deg, step_deg};
  grid.check();
  WavefrontSettings settings;
  settings.wavelength_nm = wavelength_of(eye, wavelength_nm);
  settings.stiles_crawford_per_mm2 = stiles_crawford_per_mm2;
  const py::gil_scoped_release unlocked;
  std::filesystem::create_directories(folder);
  write_field(eye, grid, settings, folder, thread_count(threads), {true});
}

ImageQuality quality_of(const Wavefront& wavefront, const PowerVector& lens_in_pupil) {
  const py::gil_scoped_release unlocked;
  return image_quality(wavefront, lens_in_pupil);
}

void bind_image_quality(py::module_& module) {
  py::class_<ImageQuality>(module, "ImageQuality", "Of a wavefront, in monochromatic light.")
      .def_readonly("strehl", &ImageQuality::strehl)
      .def_readonly("vsotf", &ImageQuality::vsotf, "Visual Strehl ratio by the OTF.")
      .def_property_readonly(
          "cpd", [](const ImageQuality& q) { return array_of(q.cpd); }, "Cycles a degree, to the cut-off.")
      .def_property_readonly(
          "mtf_tangential", [](const ImageQuality& q) { return array_of(q.mtf_tangential); },
          "Along the meridian of the field; eye y on the axis.")
      .def_property_readonly("mtf_sagittal", [](const ImageQuality& q) { return array_of(q.mtf_sagittal); });
}

}  // namespace

void bind_wavefronts(py::module_& module) {
  bind_image_quality(module);
  const auto no_lens = py::arg("lens_in_pupil") = PowerVector{};
  py::class_<Wavefront>(module, "Wavefront", "As wavefront.json has it: OSA/ANSI, um, mm, dioptres.")
      .def_readonly("wavelength_nm", &Wavefront::wavelength_nm)
      .def_readonly("pupil_mm", &Wavefront::pupil_mm, "Diameter of the Zernike terms' circle.")
      .def_readonly("pupil_position_mm", &Wavefront::pupil_position_mm)
      .def_property_readonly(
          "pupil_rim_mm", [](const Wavefront& w) { return array_of(w.rim.radius_mm); },
          "(K,): the rim from the line of sight at even angles from +x towards +y.")
      .def_property_readonly("zernike_um", [](const Wavefront& w) { return array_of(w.zernike_um); })
      .def_readonly("line_of_sight_deg", &Wavefront::line_of_sight_deg)
      .def_property_readonly("rms_um", &Wavefront::rms_um)
      .def_property_readonly("higher_order_rms_um", &Wavefront::higher_order_rms_um)
      .def_property_readonly("spot_rms_arcmin", &Wavefront::spot_rms_arcmin)
      .def_readonly("fit_residual_rms_um", &Wavefront::fit_residual_rms_um)
      .def_readonly("paraxial", &Wavefront::paraxial, "In the pupil's plane, as are the next two.")
      .def_readonly("minimum_rms_wavefront", &Wavefront::minimum_rms_wavefront)
      .def_readonly("minimum_rms_spot", &Wavefront::minimum_rms_spot)
      .def("image_quality", &quality_of, no_lens)
      .def(
          "point_spread", &spread_of, no_lens,
          "(values (N, N) float32 of unit sum, pitch_arcmin, wraps): row 0 up, columns to the patient's right; wraps "
          "where the blur is wider than the grid.")
      .def(
          "at_vertex",
          [](const Wavefront& wavefront, const PowerVector& in_pupil, double vertex_distance_mm) {
            check_vertex_distance("vertex_distance_mm", vertex_distance_mm);
            return at_vertex(wavefront, in_pupil, vertex_distance_mm);
          },
          py::arg("in_pupil"), py::arg("vertex_distance_mm") = 12,
          "The prescription at a distance from the cornea: 5 to 30 mm, or 0 of a contact lens.");
  module.def(
      "wavefront", &wavefront_of, py::arg("eye"), py::arg("retina_mm") = Eigen::Vector2d(0, 0),
      py::arg("wavelength_nm") = py::none(), py::arg("order") = 8, py::arg("stiles_crawford_per_mm2") = 0,
      py::arg("entrance_pupil_mm") = py::none(),
      "The wavefront that leaves a point of the retina (eye x, y from the pole), through the pupil as it is seen "
      "from there, or a circle of entrance_pupil_mm.");
  module.def(
      "write_field", &field_into, py::arg("eye"), py::arg("folder"), py::arg("reach_deg") = 60,
      py::arg("step_deg") = 5, py::arg("wavelength_nm") = py::none(), py::arg("stiles_crawford_per_mm2") = 0,
      py::arg("threads") = 0,
      "As trace --psf-grid: field.json, psf-grid.tiff and psf-grid.png of the visual field into a folder.");
}

}  // namespace emmetrope::python
