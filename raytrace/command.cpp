#include "raytrace/command.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <charconv>
#include <cmath>
#include <map>
#include <memory>

#include "pipeline/base/error.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/stage.hpp"

namespace emmetrope::raytrace {
namespace {

/// Reads one number at the front of `text` and drops it.
double take_number(const std::string& option, const std::string& whole, std::string_view& text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || !std::isfinite(value))
    throw usage_error(option + ": a finite number is missing in \"" + whole + "\"");
  text.remove_prefix(end - text.data());
  return value;
}

void take(const std::string& option, const std::string& whole, std::string_view& text, char expected) {
  if (text.empty() || text.front() != expected)
    throw usage_error(option + ": \"" + whole + "\" has no '" + expected + "' where it should");
  text.remove_prefix(1);
}

Eigen::Vector2d read_pair(const std::string& option, const std::string& text, char separator) {
  std::string_view rest = text;
  const double first = take_number(option, text, rest);
  take(option, text, rest, separator);
  const double second = take_number(option, text, rest);
  if (!rest.empty()) throw usage_error(option + ": \"" + text + "\" goes on after its second number");
  return {first, second};
}

void declare(CLI::App& app, TraceOptions& o) {
  app.add_option("case", o.case_folder, "Case folder, meshed")->type_name("CASE");
  app.add_option("--eye", o.eye, "Schematic eye by name, or an eye.json")->type_name("NAME|FILE");
  app.add_option("-o,--output", o.output, "With --eye: a folder, or a .png, .exr or .tiff file")
      ->type_name("PATH");
  app.add_option("--scene", o.scene, "Chart NAME[:key=value,...], or a scene.json")
      ->capture_default_str()
      ->type_name("SCENE");
  app.add_option("--surfaces", o.surfaces, "analytic, triangles, smooth or fast")->type_name("KIND");
  app.add_option("--method", o.method,
                 "pupil: rays spread over the pupil; paper: Wei, Patkar and Pai's algorithm")
      ->capture_default_str()
      ->check(CLI::IsMember({"pupil", "paper"}));
  app.add_option("--vertices", o.vertices,
                 "A surface, where a formula is meshed; or one number each, retina first")
      ->capture_default_str()
      ->type_name("N[,N...]");
  app.add_option("--size", o.size, "Pixels")->capture_default_str()->type_name("WxH");
  app.add_option("--field-mm", o.field_mm, "On the retina, mm")->capture_default_str()->type_name("XxY");
  app.add_option("--fovea", o.fovea, "Centre of the picture on the retina, mm from the pole")
      ->type_name("X,Y");
  app.add_option("--samples", o.samples,
                 "Rays a pixel, in multiples of 32 (128; with --target-error at most, 16384)");
  app.add_option("--target-error", o.settings.target_error,
                 "Add rays until the picture's rms standard error is this, of 255 levels of linear light")
      ->type_name("LEVELS");
  app.add_option("--pupil", o.pupil_mm, "Iris aperture, mm (4)")->type_name("MM");
  app.add_option("--accommodation", o.accommodation_D, "Dioptres from the relaxed eye (--eye)")
      ->type_name("D");
  app.add_option("--accommodation-parameter", o.accommodation_parameter, "The model's own (--eye)");
  app.add_option(
         "--spectacle", o.spectacle,
         "S/CxA@V[,base_D=5,prism=2@90,...]: dioptres, degrees, mm from the cornea; or a .json of surfaces")
      ->type_name("LENS|FILE");
  app.add_option("--plano-cylinder", o.plano_cylinder,
                 "Back radius mm, meridian without power deg; 10 mm away")
      ->type_name("R@AXIS");
  app.add_option("--gaze", o.gaze, "Degrees to the patient's left and up")
      ->capture_default_str()
      ->type_name("H,V");
  app.add_option("--fixate", o.fixate, "Instead: the point looked at, mm in the scene's frame")
      ->type_name("X,Y,Z")
      ->excludes("--gaze");
  app.add_option("--pupillary-distance", o.pupillary_distance_mm,
                 "mm: two eyes, the scene's frame between their apices")
      ->type_name("MM");
  app.add_option("--strabismus", o.strabismus,
                 "Deviation of one eye from --fixate, prism dioptres to the patient's left and up")
      ->type_name("od|os:H,V")
      ->needs("--fixate");
  app.add_option("--rotation-centre", o.rotation_centre_mm, "Of the eye, mm behind the apex")
      ->capture_default_str()
      ->check(CLI::Range(5.0, 25.0));
  app.add_option("--motion", o.motion, "Change of gaze during the exposure, degrees")
      ->capture_default_str()
      ->type_name("H,V");
  app.add_option("--exposure-steps", o.exposure_steps, "Where something moves: positions averaged")
      ->capture_default_str();
  app.add_option("--wavelength", o.wavelength_nm, "Monochromatic, nm (spectral)")->type_name("NM");
  app.add_flag("--achromatic", o.settings.achromatic, "Colours as at the reference wavelength: no dispersion")
      ->excludes("--wavelength");
  app.add_flag("--illuminance", o.settings.illuminance, "Weight by relative retinal illuminance");
  app.add_option("--stiles-crawford", o.settings.stiles_crawford_per_mm2,
                 "Receptors' directional weight 10^(-RHO r^2), 1/mm^2; 0.05 is usual (none)")
      ->type_name("RHO");
  app.add_flag("--diffraction", o.settings.diffraction, "Blur by diffraction at the pupil");
  app.add_option("--age", o.measured.age_years, "Years, where the study does not say (CASE)");
  app.add_option("--lens-index", o.measured.lens_index, "Equivalent index of the lens (CASE)");
  app.add_option("--lens-model", o.lens_model, "homogeneous, or core: Gullstrand's cortex and core (CASE)");
  app.add_option("--retinal-depth", o.measured.retinal_depth_mm,
                 "Photoreceptors behind the interface, mm (CASE)")
      ->capture_default_str();
}

std::vector<int> read_counts(const std::string& option, const std::string& text) {
  std::vector<int> counts;
  std::string_view rest = text;
  for (;;) {
    const double count = take_number(option, text, rest);
    if (count != std::floor(count) || count < 7 || count > 1e6)
      throw usage_error(
          fmt::format("{}: \"{}\" is not made of whole numbers from 7 to 1000000", option, text));
    counts.push_back(static_cast<int>(count));
    if (rest.empty()) return counts;
    take(option, text, rest, ',');
  }
}

}  // namespace

TraceSettings read_settings(const TraceOptions& o) {
  TraceSettings settings = o.settings;
  settings.samples = o.samples.value_or(settings.target_error ? 16384 : settings.samples);
  settings.method = o.method == "paper" ? Method::paper : Method::pupil;
  settings.vertices = read_counts("--vertices", o.vertices);
  const std::map<std::string, Representation> kinds{{"analytic", Representation::analytic},
                                                    {"triangles", Representation::triangles},
                                                    {"smooth", Representation::smooth},
                                                    {"fast", Representation::fast}};
  if (!o.surfaces.empty()) {
    const auto kind = kinds.find(o.surfaces);
    if (kind == kinds.end())
      throw usage_error("--surfaces: \"" + o.surfaces + "\" is unknown",
                        "give analytic, triangles, smooth or fast");
    settings.representation = kind->second;
  }
  const Eigen::Vector2d size = read_pair("--size", o.size, 'x'),
                        field = read_pair("--field-mm", o.field_mm, 'x');
  if (size != size.array().floor().matrix()) throw usage_error("--size: pixels are counted in whole numbers");
  settings.grid.width = static_cast<int>(std::min(size.x(), 1e9));
  settings.grid.height = static_cast<int>(std::min(size.y(), 1e9));
  settings.grid.field_x_mm = field.x();
  settings.grid.field_y_mm = field.y();
  settings.grid.centre_mm = read_pair("--fovea", o.fovea, ',');
  settings.wavelength_nm = o.wavelength_nm;
  return settings;
}

EyePose read_pose(const TraceOptions& o, Laterality laterality) {
  EyePose pose;
  pose.rotation_centre_mm = o.rotation_centre_mm;
  if (o.pupillary_distance_mm) {
    if (!(*o.pupillary_distance_mm > 0 && *o.pupillary_distance_mm < 120))
      throw usage_error(
          "--pupillary-distance: " + std::to_string(*o.pupillary_distance_mm) + " mm is out of range",
          "give up to 120, such as 62");
    pose.apex_mm.x() = (laterality == Laterality::od ? -0.5 : 0.5) * *o.pupillary_distance_mm;
  }
  Eigen::Vector2d deviation(0, 0);
  if (!o.strabismus.empty()) {
    const std::string eye = o.strabismus.substr(0, 3);
    if (eye != "od:" && eye != "os:")
      throw usage_error("--strabismus: \"" + o.strabismus + "\" does not begin with od: or os:",
                        "write os:15,0");
    const Eigen::Vector2d given = read_pair("--strabismus", o.strabismus.substr(3), ',');
    if ((eye == "od:") == (laterality == Laterality::od)) deviation = given;
  }
  if (o.fixate.empty()) {
    const Eigen::Vector2d gaze = read_pair("--gaze", o.gaze, ',');
    pose.gaze = {gaze.x(), gaze.y()};
  } else {
    std::string_view rest = o.fixate;
    Eigen::Vector3d point;
    for (int i = 0; i < 3; ++i) {
      if (i > 0) take("--fixate", o.fixate, rest, ',');
      point[i] = take_number("--fixate", o.fixate, rest);
    }
    if (!rest.empty()) throw usage_error("--fixate: \"" + o.fixate + "\" is no X,Y,Z", "write 0,0,400");
    pose.gaze = gaze_at(pose, point, deviation);
  }
  return pose;
}

Exposure read_exposure(const TraceOptions& o) {
  return {read_pair("--motion", o.motion, ','), o.exposure_steps};
}

EyeModel with_spectacle(const EyeModel& eye, const TraceOptions& o) {
  if (!o.spectacle.empty() && !o.plano_cylinder.empty())
    throw usage_error("--spectacle and --plano-cylinder exclude each other");
  if (!o.spectacle.empty()) return with_spectacle(eye, o.spectacle);
  if (!o.plano_cylinder.empty()) {
    const Eigen::Vector2d lens = read_pair("--plano-cylinder", o.plano_cylinder, '@');
    if (std::abs(lens.x()) < 10) throw usage_error("--plano-cylinder: a radius below 10 mm is no spectacle");
    if (!(lens.y() >= 0 && lens.y() <= 180))
      throw usage_error("--plano-cylinder: the axis must be 0 to 180 degrees");
    return with_plano_cylinder(eye, lens.x(), lens.y());
  }
  return eye;
}

namespace {

void refuse_options_of_a_case(const TraceOptions& options) {
  const MeasuredEyeOptions untouched;
  const bool given = options.measured.age_years || options.measured.lens_index ||
                     !options.lens_model.empty() ||
                     options.measured.retinal_depth_mm != untouched.retinal_depth_mm;
  if (given)
    throw usage_error("--age, --lens-index, --lens-model and --retinal-depth make a measured eye of a case",
                      "leave them out with --eye");
}

}  // namespace

Command command() {
  const auto options = std::make_shared<TraceOptions>();
  Command command;
  command.name = "trace";
  command.summary = "Draws what an eye sees: rays from the retina through the pupil into a scene.";
  command.example =
      "emmetrope trace CASE    or: emmetrope trace --eye navarro --scene letters:logmar=1 -o navarro.png";
  command.declare = [options](CLI::App& app) { declare(app, *options); };
  command.run = [options](const CommonOptions& common) {
    if (options->case_folder.empty() == options->eye.empty())
      throw usage_error(
          options->eye.empty() ? "neither a case nor --eye is given" : "a case and --eye exclude each other",
          "see emmetrope trace --help");
    if (options->eye.empty() && !options->output.empty())
      throw usage_error("-o: a case's pictures go into the case",
                        "leave -o away, or trace a single eye with --eye CASE/raytrace/od/eye.json -o FILE");
    if (!options->lens_model.empty() && options->lens_model != "core" && options->lens_model != "homogeneous")
      throw usage_error("--lens-model: \"" + options->lens_model + "\" is unknown",
                        "give homogeneous or core");
    options->measured.lens_core = options->lens_model == "core";
    if (!options->eye.empty()) refuse_options_of_a_case(*options);
    const std::string deviating = options->strabismus.substr(0, 2);
    if ((deviating == "od" && common.laterality == LateralityChoice::os) ||
        (deviating == "os" && common.laterality == LateralityChoice::od))
      throw usage_error("--strabismus: " + deviating + " is the eye that --laterality leaves out");
    options->settings.seed = common.seed;
    options->settings.verbosity = common.verbosity;
    return options->eye.empty() ? trace_case(*options, common) : trace_named(*options, common);
  };
  return command;
}

}  // namespace emmetrope::raytrace
