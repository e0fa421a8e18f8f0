#include <fmt/format.h>

#include <utility>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/exchange/eye_file.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/optics/retina_point.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "pipeline/python/bindings.hpp"
#include "raytrace/case/measured_eye.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/wavefront/field.hpp"

namespace emmetrope::python {
namespace {

Laterality laterality_of(const std::string& name) {
  if (name == "od") return Laterality::od;
  if (name == "os") return Laterality::os;
  throw usage_error("laterality: \"" + name + "\" is unknown", "give od or os");
}

void check_pupil(double pupil_mm) { check_setting("pupil_mm", pupil_mm, iris_aperture_mm, " mm"); }

EyeModel measured_eye(const std::string& case_folder, const std::string& laterality, double pupil_mm,
                      const std::optional<double>& age_years, const std::optional<double>& lens_index,
                      bool lens_core, const std::optional<double>& retinal_depth_mm) {
  check_pupil(pupil_mm);
  if (age_years) check_setting("age_years", *age_years, human_age_years, " years");
  if (lens_index) check_setting("lens_index", *lens_index, human_lens_index);
  if (retinal_depth_mm)
    check_setting("retinal_depth_mm", *retinal_depth_mm, {0, most_retinal_depth_mm}, " mm");
  raytrace::MeasuredEyeOptions options;
  options.age_years = age_years;
  options.lens_index = lens_index;
  options.lens_core = lens_core;
  options.retinal_depth_mm = retinal_depth_mm;
  options.pupil_mm = pupil_mm;
  const Laterality eye = laterality_of(laterality);
  read_verdict(case_folder, "meshing");  // finished, and of one piece
  raytrace::MeasuredEye measured = raytrace::read_measured_eye(case_folder, eye, options);
  warn(measured.warning);
  return std::move(measured.eye);
}

EyeModel new_eye(const std::string& name_or_file, double accommodation_D,
                 const std::optional<double>& accommodation_parameter, const std::optional<double>& pupil_mm,
                 const std::string& laterality) {
  if (pupil_mm) check_pupil(*pupil_mm);
  EyeOptions options;
  options.accommodation_D = accommodation_D;
  options.accommodation_parameter = accommodation_parameter;
  options.pupil_mm = pupil_mm;
  options.laterality = laterality_of(laterality);
  return make_eye(name_or_file, options);
}

EyeModel with_pupil_of(EyeModel eye, double pupil_mm) {
  check_pupil(pupil_mm);
  eye.set_stop_diameter(pupil_mm);
  return eye;
}

std::vector<std::string> surface_names(const EyeModel& eye) {
  std::vector<std::string> names;
  for (const Surface& surface : eye.surfaces) names.push_back(surface.name);
  return names;
}

void bind_power_vector(py::module_& module) {
  py::class_<PowerVector>(
      module, "PowerVector",
      "A refraction, dioptres: mean sphere M and the cross cylinders J0 (180 against 90) and "
      "J45 (45 against 135 degrees).")
      .def(py::init([](double M_D, double J0_D, double J45_D) {
             return PowerVector{M_D, J0_D, J45_D};
           }),
           py::arg("M_D") = 0, py::arg("J0_D") = 0, py::arg("J45_D") = 0)
      .def_readonly("M_D", &PowerVector::M_D)
      .def_readonly("J0_D", &PowerVector::J0_D)
      .def_readonly("J45_D", &PowerVector::J45_D)
      .def(
          "sphero_cylinder",
          [](const PowerVector& power) {
            const SpheroCylinder rx = to_sphero_cylinder(power);
            return py::make_tuple(rx.sphere_D, rx.cylinder_D, rx.axis_deg);
          },
          "(sphere_D, cylinder_D, axis_deg), the cylinder negative.")
      .def("__repr__", [](const PowerVector& power) {
        const auto shown = [](double power_D) { return without_negative_zero(power_D, 4); };
        return fmt::format("PowerVector(M_D={:.4f}, J0_D={:.4f}, J45_D={:.4f})", shown(power.M_D),
                           shown(power.J0_D), shown(power.J45_D));
      });
}

void bind_cardinal_points(py::module_& module) {
  py::class_<CardinalPoints>(module, "CardinalPoints",
                             "Depths behind the corneal apex, mm, and the power, D.")
      .def_readonly("power_D", &CardinalPoints::power_D)
      .def_readonly("object_focal_mm", &CardinalPoints::object_focal_mm)
      .def_readonly("image_focal_mm", &CardinalPoints::image_focal_mm)
      .def_readonly("object_principal_mm", &CardinalPoints::object_principal_mm)
      .def_readonly("image_principal_mm", &CardinalPoints::image_principal_mm)
      .def_readonly("object_nodal_mm", &CardinalPoints::object_nodal_mm)
      .def_readonly("image_nodal_mm", &CardinalPoints::image_nodal_mm);
}

}  // namespace

void bind_eyes(py::module_& module) {
  bind_power_vector(module);
  bind_cardinal_points(module);
  const auto wavelength = py::arg("wavelength_nm") = py::none();
  py::class_<EyeModel>(
      module, "Eye",
      "An optical system in the eye's frame: mm, +z out of the eye, origin at the corneal apex, +x to "
      "the patient's left, +y up. It does not change; with_... make another.")
      .def(
          py::init(&new_eye), py::arg("name_or_file"), py::arg("accommodation_D") = 0,
          py::arg("accommodation_parameter") = py::none(), py::arg("pupil_mm") = py::none(),
          py::arg("laterality") = "od",
          "A schematic eye by name (schematic_eyes()), an eye.json by its path, also a case's, or a lens of Zemax (.zmx), "
          "Optiland or visisipy (.json).")
      .def_static(
          "from_case", &measured_eye, py::arg("case_folder"), py::arg("laterality") = "od",
          py::arg("pupil_mm") = 4.0, py::arg("age_years") = py::none(), py::arg("lens_index") = py::none(),
          py::arg("lens_core") = false, py::arg("retinal_depth_mm") = py::none(),
          "A measured eye from the meshes of a case, as trace has it. Meshes that are not what mesh wrote are refused; "
          "an age that is not the study's is not used, and warned of.")
      .def_static(
          "from_dict",
          [](const py::object& dictionary, const std::string& folder) {
            return eye_from_json(from_python(dictionary), folder);
          },
          py::arg("dictionary"), py::arg("folder") = ".",
          "From what eye.json holds; paths of meshes are relative to the folder.")
      .def(
          "to_dict", [](const EyeModel& eye) { return to_python(to_json(eye)); }, "What eye.json would hold.")
      .def(
          "write",
          [](const EyeModel& eye, const std::string& file) {
            WrittenEye written = write_eye_file(file, eye);
            if (!written.warning.empty()) written.notes.push_back(written.warning);
            return written.notes;
          },
          py::arg("file"),
          "Writes an eye.json, or a lens of Zemax where the file ends in .zmx; returns what the format could not hold "
          "exactly.")
      .def_readonly("name", &EyeModel::name)
      .def_readonly("reference_wavelength_nm", &EyeModel::reference_wavelength_nm)
      .def_property_readonly("axial_length_mm", &EyeModel::axial_length_mm)
      .def_property_readonly("surface_names", &surface_names, "In the order that light meets them.")
      .def("with_pupil", &with_pupil_of, py::arg("pupil_mm"), "With another iris aperture, 0.5 to 9 mm.")
      .def(
          "with_spectacle",
          [](const EyeModel& eye, const std::string& lens) {
            return raytrace::with_spectacle(eye, raytrace::parse_spectacle(lens));
          },
          py::arg("lens"),
          "Behind a lens as --spectacle takes it: \"-2.25/-1.00x180@12\", or a file of surfaces.")
      .def(
          "cardinal_points",
          [](const EyeModel& eye, const std::optional<double>& nm) {
            return cardinal_points(eye, wavelength_of(eye, nm));
          },
          wavelength)
      .def(
          "entrance_pupil",
          [](const EyeModel& eye, const std::optional<double>& nm) {
            const Pupil pupil = entrance_pupil(eye, wavelength_of(eye, nm));
            return py::make_tuple(pupil.position_mm, pupil.diameter_mm);
          },
          wavelength, "Paraxial (position_mm behind the apex, diameter_mm).")
      .def(
          "refraction",
          [](const EyeModel& eye, const std::optional<double>& nm) {
            return paraxial_refraction(eye, wavelength_of(eye, nm));
          },
          wavelength, "Paraxial, of the pole, at the corneal vertex: what corrects the eye.")
      .def(
          "retina_seeing",
          [](const EyeModel& eye, double horizontal_deg, double vertical_deg,
             const std::optional<double>& nm) -> std::optional<Eigen::Vector3d> {
            const double at_nm = wavelength_of(eye, nm);
            const py::gil_scoped_release unlocked;
            const ChiefRays chief_rays(eye, at_nm);
            return raytrace::retina_seeing(chief_rays, {horizontal_deg, vertical_deg});
          },
          py::arg("horizontal_deg"), py::arg("vertical_deg"), wavelength,
          "Where the chief ray from a direction meets the retina, mm (3,); None where none does. Angles of the line "
          "of sight towards +x and +y, below 90, or one up to 180 and 0. In front of the retina's equator x and y do not "
          "tell the place: wavefront() and line_of_sight() take those behind it.")
      .def(
          "line_of_sight",
          [](const EyeModel& eye, double x_mm, double y_mm,
             const std::optional<double>& nm) -> std::optional<Eigen::Vector3d> {
            const std::optional<RetinaPoint> from = meet_retina(eye, {x_mm, y_mm});
            if (!from) return std::nullopt;
            const double at_nm = wavelength_of(eye, nm);
            const py::gil_scoped_release unlocked;
            const auto ray = ChiefRays(eye, at_nm).line_of_sight(from->position_mm);
            return ray ? std::optional<Eigen::Vector3d>(ray->direction) : std::nullopt;
          },
          py::arg("x_mm"), py::arg("y_mm"), wavelength,
          "Direction (3,) in which the retina at x, y looks; None where it does not reach or no light leaves.")
      .def("__repr__", [](const EyeModel& eye) {
        return fmt::format("Eye('{}', {} surfaces, axial length {:.3f} mm)", eye.name, eye.surfaces.size(),
                           eye.axial_length_mm());
      });
  module.def(
      "_require_finished",
      [](const std::string& case_folder, const std::string& stage) { read_verdict(case_folder, stage); },
      py::call_guard<py::gil_scoped_release>());
  module.def("schematic_eyes", &schematic_eye_names, "Names that Eye() knows.");
}

}  // namespace emmetrope::python
