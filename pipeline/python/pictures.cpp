#include "pipeline/base/error.hpp"
#include "pipeline/python/bindings.hpp"
#include "raytrace/radiometry/irradiance.hpp"
#include "raytrace/retina/field_points.hpp"
#include "raytrace/scene/scene.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::python {
namespace {

using namespace raytrace;

using Pair = std::pair<double, double>;

/// With hyphens, as --projection has it, or underscores, as stage.json has it.
Projection projection_of(std::string name) {
  std::replace(name.begin(), name.end(), '-', '_');
  for (const Projection projection :
       {Projection::retina_plane, Projection::retina_arc, Projection::visual_angle, Projection::perspective})
    if (name == to_string(projection)) return projection;
  throw usage_error("projection: \"" + name + "\" is unknown",
                    "give retina-plane, retina-arc, visual-angle or perspective");
}

TraceSettings settings_of(const std::pair<int, int>& size, const std::optional<Pair>& field_mm,
                          const std::optional<Pair>& field_deg, const std::optional<std::string>& projection,
                          const Eigen::Vector2d& centre_mm, int samples,
                          const std::optional<double>& wavelength_nm, std::uint64_t seed) {
  if (field_mm && field_deg)
    throw usage_error("field_mm and field_deg exclude each other", "give one of them");
  TraceSettings settings;
  settings.grid.width = size.first;
  settings.grid.height = size.second;
  settings.grid.centre_mm = centre_mm;
  if (field_mm) std::tie(settings.grid.field_x_mm, settings.grid.field_y_mm) = *field_mm;
  if (field_deg) {
    settings.grid.projection = Projection::visual_angle;
    settings.grid.field_deg = {field_deg->first, field_deg->second};
  }
  if (projection) settings.grid.projection = projection_of(*projection);
  if (settings.grid.is_angular() != field_deg.has_value())
    throw usage_error("field_deg belongs to the projections visual-angle and perspective, and they to it");
  settings.samples = samples;
  settings.wavelength_nm = wavelength_nm;
  settings.seed = seed;
  settings.verbosity.quiet = true;
  return settings;
}

py::array_t<float> array_of(const LinearImage& image) {
  std::vector<py::ssize_t> shape{image.height, image.width};
  if (image.channels > 1) shape.push_back(image.channels);
  py::array_t<float> pixels(shape);
  std::copy(image.values.begin(), image.values.end(), pixels.mutable_data());
  return pixels;
}

/// A picture, and where its pixels lie.
struct Picture {
  TraceResult traced;
  RetinalGrid grid;
};
struct Irradiance {
  RetinalIrradiance light;
  RetinalGrid grid;
};

/// Places of columns and rows: {name with its unit: values}, the columns' first.
py::dict axes_of(const RetinalGrid& grid) {
  const auto places = [](double centre, double half, int count) {
    py::array_t<double> values(count);
    for (int k = 0; k < count; ++k) values.mutable_at(k) = centre + half * ((2.0 * k + 1) / count - 1);
    return values;
  };
  const Eigen::Vector2d half = half_of(grid);
  const bool angular = grid.is_angular();
  const char* unit = !angular ? "_mm" : grid.projection == Projection::perspective ? "_tangent" : "_deg";
  const Eigen::Vector2d centre = angular ? Eigen::Vector2d(0, 0) : grid.centre_mm;
  py::dict axes;
  axes[py::str(std::string(angular ? "right" : "x") + unit)] = places(centre.x(), half.x(), grid.width);
  axes[py::str(std::string(angular ? "down" : "y") + unit)] = places(centre.y(), half.y(), grid.height);
  return axes;
}

/// (height, width): true where the eye sees.
py::array_t<bool> seen_of(const LinearImage& image, const std::vector<char>& unseen) {
  py::array_t<bool> seen({image.height, image.width});
  for (std::size_t i = 0; i < static_cast<std::size_t>(image.width) * image.height; ++i)
    seen.mutable_data()[i] = unseen.empty() || unseen[i] == 0;
  return seen;
}

py::array_t<float> bands_of(const RetinalIrradiance& light, bool photons) {
  const LinearImage& first = light.irradiance.front();
  py::array_t<float> bands({static_cast<int>(light.irradiance.size()), first.height, first.width});
  float* to = bands.mutable_data();
  for (std::size_t k = 0; k < light.irradiance.size(); ++k) {
    const auto unit = static_cast<float>(photons ? photons_per_joule(light.wavelength_nm[k]) : 1);
    for (const float value : light.irradiance[k].values) *to++ = unit * value;
  }
  return bands;
}

py::dict states_of(const TraceResult& result) {
  py::dict states;
  for (const auto& [state, count] : result.states) states[to_string(state)] = count;
  return states;
}

void bind_picture(py::module_& module) {
  py::class_<Picture>(module, "Picture", "What an eye sees.")
      .def_property_readonly(
          "linear", [](const Picture& picture) { return array_of(picture.traced.image); },
          "(height, width, 3) float32: linear light, upright as the patient perceives it.")
      .def_property_readonly(
          "seen", [](const Picture& picture) { return seen_of(picture.traced.image, picture.traced.unseen); },
          "(height, width) bool: false where the eye sees nothing.")
      .def_property_readonly(
          "axes", [](const Picture& picture) { return axes_of(picture.grid); },
          "Where columns and rows lie: x_mm and y_mm on the retina (eye frame), or right_deg and down_deg, right_tangent "
          "and down_tangent as the patient perceives them, from the line of sight of the picture's centre.")
      .def_property_readonly(
          "states", [](const Picture& picture) { return states_of(picture.traced); },
          "How many rays ended how.")
      .def_property_readonly("rays", [](const Picture& picture) { return picture.traced.rays; })
      .def_property_readonly(
          "samples", [](const Picture& picture) { return picture.traced.samples; }, "Rays a pixel.")
      .def_property_readonly("wall_s", [](const Picture& picture) { return picture.traced.wall_s; })
      .def_property_readonly("device", [](const Picture& picture) { return picture.traced.device; })
      .def(
          "write_png",
          [](const Picture& picture, const std::string& file) {
            write_png(file, with_cover(picture.traced.image, picture.traced.unseen));
          },
          py::arg("file"), "As sRGB, clear where the eye sees nothing.");
}

void bind_irradiance(py::module_& module) {
  py::class_<Irradiance>(module, "Irradiance", "Light on the retina in physical units.")
      .def_property_readonly("wavelength_nm", [](const Irradiance& i) { return i.light.wavelength_nm; })
      .def_property_readonly(
          "irradiance", [](const Irradiance& i) { return bands_of(i.light, false); },
          "(bands, height, width) float32, W / (m^2 nm).")
      .def_property_readonly(
          "photons", [](const Irradiance& i) { return bands_of(i.light, true); },
          "(bands, height, width) float32, photons / (s m^2 nm).")
      .def_property_readonly(
          "cones", [](const Irradiance& i) { return array_of(i.light.cones); },
          "(height, width, 3) float32: long, middle and short wavelength cones, W / m^2.")
      .def_property_readonly(
          "trolands", [](const Irradiance& i) { return array_of(i.light.trolands); },
          "(height, width) float32.")
      .def_property_readonly(
          "seen", [](const Irradiance& i) { return seen_of(i.light.cones, i.light.unseen); },
          "(height, width) bool: false where the eye sees nothing.")
      .def_property_readonly(
          "axes", [](const Irradiance& i) { return axes_of(i.grid); }, "As Picture.axes.")
      .def_property_readonly(
          "transmittance", [](const Irradiance& i) { return i.light.transmittance; },
          "Of the media, in the irradiance.")
      .def_property_readonly(
          "white_radiance", [](const Irradiance& i) { return i.light.white_radiance; }, "W / (m^2 sr nm).")
      .def_property_readonly("pupil_area_mm2", [](const Irradiance& i) { return i.light.pupil_area_mm2; })
      .def_property_readonly("white_trolands", [](const Irradiance& i) { return i.light.white_trolands; })
      .def_property_readonly("rays", [](const Irradiance& i) { return i.light.rays; });
}

}  // namespace

void bind_pictures(py::module_& module) {
  bind_picture(module);
  bind_irradiance(module);
  py::class_<Tracer>(module, "Tracer", "OpenCL devices with their compiled kernels.")
      .def(py::init([](const std::string& device, int threads) {
             check_threads(threads);
             return Tracer(device, threads);
           }),
           py::arg("device") = "", py::arg("threads") = 0,
           "device: an index, a part of a name, or \"all\"; the first where it is empty.")
      .def_property_readonly("device_name", &Tracer::device_name)
      .def(
          "picture",
          [](const Tracer& tracer, const EyeModel& eye, const std::string& scene,
             const std::pair<int, int>& size, const std::optional<Pair>& field_mm,
             const Eigen::Vector2d& centre_mm, int samples, const std::optional<double>& wavelength_nm,
             std::uint64_t seed, const std::optional<Pair>& field_deg,
             const std::optional<std::string>& projection) {
            const TraceSettings settings =
                settings_of(size, field_mm, field_deg, projection, centre_mm, samples, wavelength_nm, seed);
            const py::gil_scoped_release unlocked;
            return Picture{tracer.trace(eye, *make_scene(scene), settings), settings.grid};
          },
          py::arg("eye"), py::arg("scene") = "letters", py::arg("size") = std::pair(500, 500),
          py::arg("field_mm") = py::none(), py::arg("centre_mm") = Eigen::Vector2d(0, 0),
          py::arg("samples") = 128, py::arg("wavelength_nm") = py::none(), py::arg("seed") = 1,
          py::arg("field_deg") = py::none(), py::arg("projection") = py::none(),
          "The retinal image of a scene, a chart NAME[:key=value,...] or a scene.json.\n\n"
          "size: pixels (width, height); field_mm: on the retina (6, 6); centre_mm: from the pole; samples: rays a pixel;\n"
          "field_deg: instead of field_mm, of the visual field; projection: retina-plane, retina-arc, visual-angle or\n"
          "perspective.")
      .def(
          "irradiance",
          [](const Tracer& tracer, const EyeModel& eye, const std::string& scene,
             const std::pair<int, int>& size, const std::optional<Pair>& field_mm,
             const Eigen::Vector2d& centre_mm, int samples, std::uint64_t seed,
             const std::optional<Pair>& field_deg, const std::optional<std::string>& projection,
             double luminance_cd_m2, const std::tuple<double, double, double>& bands_nm,
             const std::optional<double>& media_age_years) {
            const TraceSettings settings =
                settings_of(size, field_mm, field_deg, projection, centre_mm, samples, std::nullopt, seed);
            IrradianceSettings light;
            light.luminance_cd_m2 = luminance_cd_m2;
            std::tie(light.first_nm, light.last_nm, light.step_nm) = bands_nm;
            light.age_years = media_age_years;
            const py::gil_scoped_release unlocked;
            return Irradiance{retinal_irradiance(tracer, eye, *make_scene(scene), settings, {}, light),
                              settings.grid};
          },
          py::arg("eye"), py::arg("scene") = "letters", py::arg("size") = std::pair(500, 500),
          py::arg("field_mm") = py::none(), py::arg("centre_mm") = Eigen::Vector2d(0, 0),
          py::arg("samples") = 128, py::arg("seed") = 1, py::arg("field_deg") = py::none(),
          py::arg("projection") = py::none(), py::arg("luminance_cd_m2") = 100.0,
          py::arg("bands_nm") = std::tuple(400.0, 700.0, 10.0), py::arg("media_age_years") = py::none(),
          "Spectral irradiance of the retina and the cones' excitations, where the scene's white has a luminance.\n\n"
          "bands_nm: (first, last, step); media_age_years: of the media's transmittance (40).");
}

}  // namespace emmetrope::python
