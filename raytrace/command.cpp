#include "raytrace/command.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "pipeline/base/eye_stage.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "raytrace/named_eye.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/text_reader.hpp"
#include "raytrace/stage.hpp"

namespace emmetrope::raytrace {
namespace {

/// As it is typed.
struct Flags {
  std::string case_folder, eye, output;
  std::string surfaces, method = "pupil", vertices = "800", size = "500x500", field_mm, field_deg, projection,
                        fovea;
  std::string spectacle, plano_cylinder, lens_model;
  std::string psf_grid, bands = "400:700:10", media_field = "small";
  std::vector<std::string> irradiance_formats, discs;
  std::optional<double> luminance_cd_m2, media_age_years;
  std::string movement;
  double frame_rate_hz = MovieSettings().frame_rate_hz;
  std::string gaze = "0,0", fixate, strabismus, motion = "0,0";
  double rotation_centre_mm = EyePose().rotation_centre_mm;
  std::optional<int> samples;
  std::optional<double> pupil_mm, accommodation_D, accommodation_parameter;
  MeasuredEyeOptions measured;
  TraceOptions options;
};

void declare_eye_and_scene(CLI::App& app, Flags& flags) {
  app.add_option("case", flags.case_folder, "Case folder, meshed")->type_name("CASE");
  app.add_option("--eye", flags.eye, "Schematic eye by name, or an eye.json")->type_name("NAME|FILE");
  app.add_option("-o,--output", flags.output, "With --eye: a folder, or a .png, .exr or .tiff file")
      ->type_name("PATH");
  app.add_option("--scene", flags.options.scene, "Chart NAME[:key=value,...], or a scene.json")
      ->capture_default_str()
      ->type_name("SCENE");
  app.add_option("--surfaces", flags.surfaces, "analytic, triangles, smooth or fast")->type_name("KIND");
  app.add_option("--method", flags.method,
                 "pupil: rays spread over the pupil; paper: Wei, Patkar and Pai's algorithm")
      ->capture_default_str()
      ->check(CLI::IsMember({"pupil", "paper"}));
  app.add_option("--vertices", flags.vertices,
                 "A surface, where a formula is meshed; or one number each, retina first")
      ->capture_default_str()
      ->type_name("N[,N...]");
}

void declare_picture(CLI::App& app, Flags& flags) {
  app.add_option("--size", flags.size, "Pixels")->capture_default_str()->type_name("WxH");
  auto* field_mm = app.add_option("--field-mm", flags.field_mm, "On the retina, mm (6x6)")->type_name("XxY");
  app.add_option("--field-deg", flags.field_deg, "Instead: of the visual field, degrees, to 250")
      ->type_name("WxH")
      ->excludes(field_mm);
  app.add_option(
         "--projection", flags.projection,
         "Pixels are equidistant on the retina's plane or along it (--field-mm), in visual angle or in its "
         "tangents (--field-deg)")
      ->type_name("KIND")
      ->check(CLI::IsMember({"retina-plane", "retina-arc", "visual-angle", "perspective"}));
  app.add_option(
         "--fovea", flags.fovea,
         "Centre of the picture on the retina, mm from the pole, with its standard deviation where it was measured")
      ->type_name("X,Y[+-S]");
  app.add_option("--disc", flags.discs, "The optic disc's centre in the same way, for visual-field.json")
      ->allow_extra_args(false)
      ->type_name("[od:|os:]X,Y[+-S]");
  app.add_option("--samples", flags.samples,
                 "Rays a pixel, in multiples of 32 (128; with --target-error at most, 16384)");
  app.add_option("--target-error", flags.options.settings.target_error,
                 "Add rays until the picture's rms standard error is this, of 255 levels of linear light")
      ->type_name("LEVELS");
}

void declare_field(CLI::App& app, Flags& flags) {
  app.add_option("--psf-grid", flags.psf_grid,
                 "Into the folder too: refraction, wavefront, MTF and PSF over the visual field, degrees")
      ->type_name("REACH:STEP");
}

void declare_pupil_and_lens(CLI::App& app, Flags& flags) {
  app.add_option("--pupil", flags.pupil_mm, "Iris aperture, mm (4)")
      ->check(CLI::Range(iris_aperture_mm.low, iris_aperture_mm.high))
      ->type_name("MM");
  app.add_option("--accommodation", flags.accommodation_D, "Dioptres from the relaxed eye (--eye)")
      ->type_name("D");
  app.add_option("--accommodation-parameter", flags.accommodation_parameter, "The model's own (--eye)");
  app.add_option(
         "--spectacle", flags.spectacle,
         "S/CxA@V[,base_D=5,prism=2@90,...]: dioptres, degrees, mm from the cornea; or a .json of surfaces")
      ->type_name("LENS|FILE");
  app.add_option("--plano-cylinder", flags.plano_cylinder,
                 "Back radius mm, meridian without power deg; 10 mm away")
      ->type_name("R@AXIS");
}

void declare_gaze(CLI::App& app, Flags& flags) {
  app.add_option("--gaze", flags.gaze, "Degrees to the patient's left and up")
      ->capture_default_str()
      ->type_name("H,V");
  app.add_option("--fixate", flags.fixate, "Instead: the point looked at, mm in the scene's frame")
      ->type_name("X,Y,Z")
      ->excludes("--gaze");
  app.add_option("--pupillary-distance", flags.options.pupillary_distance_mm,
                 "mm: two eyes, the scene's frame between their apices")
      ->type_name("MM");
  app.add_option("--strabismus", flags.strabismus,
                 "Deviation of one eye from --fixate, prism dioptres to the patient's left and up")
      ->type_name("od|os:H,V")
      ->needs("--fixate");
  app.add_option("--rotation-centre", flags.rotation_centre_mm, "Of the eye, mm behind the apex")
      ->capture_default_str()
      ->check(CLI::Range(5.0, 25.0));
  app.add_option("--motion", flags.motion, "Change of gaze during the exposure, degrees")
      ->capture_default_str()
      ->type_name("H,V");
  app.add_option("--exposure-steps", flags.options.exposure.steps,
                 "Where something moves: positions averaged")
      ->capture_default_str();
}

void declare_movement(CLI::App& app, Flags& flags) {
  auto* movement =
      app.add_option(
             "--movement", flags.movement,
             "Into the folder too, a movie: gaze, vergence, accommodation, pupil from a table, or by a model: "
             "saccade, pursuit, drift, microsaccades, fixation")
          ->type_name("FILE.csv|MODEL[:key=value,...]");
  for (const char* still :
       {"--gaze", "--fixate", "--motion", "--strabismus", "--accommodation", "--accommodation-parameter"})
    movement->excludes(still);
  app.add_option("--frame-rate", flags.frame_rate_hz, "Of the movie, 1/s")
      ->capture_default_str()
      ->needs(movement);
}

void declare_light(CLI::App& app, Flags& flags) {
  app.add_option("--wavelength", flags.options.settings.wavelength_nm, "Monochromatic, nm (spectral)")
      ->type_name("NM");
  app.add_flag("--achromatic", flags.options.settings.achromatic,
               "Colours as at the reference wavelength: no dispersion")
      ->excludes("--wavelength");
  app.add_flag("--illuminance", flags.options.settings.illuminance, "Weight by relative retinal illuminance");
  app.add_option("--stiles-crawford", flags.options.settings.stiles_crawford_per_mm2,
                 "Receptors' directional weight 10^(-RHO r^2), 1/mm^2; 0.05 is usual (none)")
      ->type_name("RHO");
  app.add_flag("--diffraction", flags.options.settings.diffraction, "Blur by diffraction at the pupil");
}

void declare_radiometry(CLI::App& app, Flags& flags) {
  auto* irradiance =
      app.add_option(
             "--irradiance", flags.luminance_cd_m2,
             "Into the folder too: spectral irradiance of the retina, where the scene's white has this luminance")
          ->type_name("CD_M2");
  app.add_option("--bands", flags.bands, "Its wavelengths, nm")
      ->capture_default_str()
      ->type_name("FIRST:LAST:STEP")
      ->needs(irradiance);
  app.add_option("--media-age", flags.media_age_years,
                 "Years, of the media's transmittance (the subject's, else 40)")
      ->needs(irradiance);
  app.add_option("--media-field", flags.media_field,
                 "Their scatter: small, light that leaves the sharp image is lost; large, as much comes in")
      ->check(CLI::IsMember({"small", "large"}))
      ->capture_default_str()
      ->needs(irradiance);
  app.add_option("--irradiance-format", flags.irradiance_formats,
                 "Its files: tiff, exr, mat, isetbio (tiff,mat)")
      ->delimiter(',')
      ->check(CLI::IsMember(irradiance_formats).description(""))
      ->type_name("KIND[,KIND...]")
      ->needs(irradiance);
  app.add_flag("--photons", flags.options.irradiance_files.photons,
               "Photons / (s m^2 nm) instead of W / (m^2 nm)")
      ->needs(irradiance);
}

void declare_measured_eye(CLI::App& app, Flags& flags) {
  app.add_option("--age", flags.measured.age_years, "Years, where the study does not say (CASE)")
      ->check(CLI::Range(human_age_years.low, human_age_years.high));
  app.add_option("--lens-index", flags.measured.lens_index, "Equivalent index of the lens (CASE)")
      ->check(CLI::Range(human_lens_index.low, human_lens_index.high));
  app.add_option("--lens-model", flags.lens_model,
                 "homogeneous, or core: Gullstrand's cortex and core (CASE)");
  app.add_option("--retinal-depth", flags.measured.retinal_depth_mm,
                 "Photoreceptors behind the interface, mm, as the case was meshed (CASE)")
      ->check(CLI::Range(0.0, most_retinal_depth_mm));
}

void declare(CLI::App& app, Flags& flags) {
  declare_eye_and_scene(app, flags);
  declare_picture(app, flags);
  declare_field(app, flags);
  declare_pupil_and_lens(app, flags);
  declare_gaze(app, flags);
  declare_movement(app, flags);
  declare_light(app, flags);
  declare_radiometry(app, flags);
  declare_measured_eye(app, flags);
}

/// Reads an option's numbers, or says what is wrong with them.
class NumbersOf {
 public:
  NumbersOf(std::string option, const std::string& text)
      : option_(std::move(option)), whole_(text), rest_(whole_) {}

  bool done() const { return rest_.done(); }
  double number() {
    if (const auto value = rest_.number()) return *value;
    throw usage_error(option_ + ": a finite number is missing in \"" + whole_ + "\"");
  }
  void need(char expected) {
    if (!rest_.take(expected))
      throw usage_error(option_ + ": \"" + whole_ + "\" has no '" + expected + "' where it should");
  }

 private:
  std::string option_;
  const std::string& whole_;
  TextReader rest_;
};

Eigen::Vector2d parse_pair(const std::string& option, const std::string& text, char separator) {
  NumbersOf rest(option, text);
  const double first = rest.number();
  rest.need(separator);
  const double second = rest.number();
  if (!rest.done()) throw usage_error(option + ": \"" + text + "\" goes on after its second number");
  return {first, second};
}

Eigen::Vector3d parse_point(const std::string& option, const std::string& text) {
  NumbersOf rest(option, text);
  Eigen::Vector3d point;
  for (int i = 0; i < 3; ++i) {
    if (i > 0) rest.need(',');
    point[i] = rest.number();
  }
  if (!rest.done()) throw usage_error(option + ": \"" + text + "\" is no X,Y,Z", "write 0,0,400");
  return point;
}

std::vector<int> parse_counts(const std::string& option, const std::string& text) {
  std::vector<int> counts;
  NumbersOf rest(option, text);
  for (;;) {
    const double count = rest.number();
    if (count != std::floor(count) || count < 7 || count > 1e6)
      throw usage_error(
          fmt::format("{}: \"{}\" is not made of whole numbers from 7 to 1000000", option, text));
    counts.push_back(static_cast<int>(count));
    if (rest.done()) return counts;
    rest.need(',');
  }
}

Representation parse_representation(const std::string& text) {
  for (const Representation kind :
       {Representation::analytic, Representation::triangles, Representation::smooth, Representation::fast})
    if (text == to_string(kind)) return kind;
  throw usage_error("--surfaces: \"" + text + "\" is unknown", "give analytic, triangles, smooth or fast");
}

Projection parse_projection(const Flags& flags) {
  const bool angular = !flags.field_deg.empty();
  if (flags.projection.empty()) return angular ? Projection::visual_angle : Projection::retina_plane;
  const bool wants_angle = flags.projection == "visual-angle" || flags.projection == "perspective";
  if (wants_angle && !angular)
    throw usage_error("--projection " + flags.projection + ": its field is given in degrees",
                      "write --field-deg 120x90");
  if (!wants_angle && angular)
    throw usage_error("--projection " + flags.projection + ": its field is given in mm on the retina",
                      "write --field-mm 40x40");
  if (wants_angle)
    return flags.projection == "perspective" ? Projection::perspective : Projection::visual_angle;
  return flags.projection == "retina-arc" ? Projection::retina_arc : Projection::retina_plane;
}

Landmark parse_landmark(const std::string& option, const std::string& text) {
  const std::size_t spread = text.find("+-");
  Landmark landmark{parse_pair(option, text.substr(0, spread), ',')};
  if (spread == std::string::npos) return landmark;
  const std::string behind = text.substr(spread + 2);
  NumbersOf rest(option, behind);
  landmark.sigma_mm = rest.number();
  if (!rest.done()) throw usage_error(option + ": \"" + text + "\" goes on after its standard deviation");
  return landmark;
}

/// Of a case, or a pair, what is asked for; else one eye.
std::vector<Laterality> eyes_traced(const Flags& flags, LateralityChoice wanted) {
  const bool one = !flags.eye.empty() && !flags.options.pupillary_distance_mm;
  if (one && wanted == LateralityChoice::both) return {Laterality::od};
  return eyes_asked_for(wanted);
}

/// By eye; a disc without one is that of the only eye.
/// \param eyes  that are traced
std::map<Laterality, Landmarks> parse_landmarks(const Flags& flags, const std::vector<Laterality>& eyes) {
  std::map<Laterality, Landmarks> landmarks;
  for (const std::string& text : flags.discs) {
    const bool names_eye = text.rfind("od:", 0) == 0 || text.rfind("os:", 0) == 0;
    const bool traced = std::any_of(eyes.begin(), eyes.end(),
                                    [&](Laterality eye) { return text.substr(0, 2) == to_string(eye); });
    if (!names_eye && eyes.size() > 1)
      throw usage_error("--disc " + text + ": +x is nasal in a right eye and temporal in a left one",
                        "say of which: od:" + text);
    if (names_eye && !traced) throw usage_error("--disc " + text + ": that eye is not traced");
  }
  for (const Laterality eye : eyes) {
    if (!flags.fovea.empty()) landmarks[eye].fovea = parse_landmark("--fovea", flags.fovea);
    if (landmarks[eye].fovea && landmarks[eye].fovea->from_pole_mm.x() != 0 && eyes.size() > 1)
      throw usage_error("--fovea " + flags.fovea + ": +x is nasal in a right eye and temporal in a left one",
                        "trace one eye, with --laterality od or os");
    for (const std::string& text : flags.discs) {
      const bool names_eye = text.rfind("od:", 0) == 0 || text.rfind("os:", 0) == 0;
      if (names_eye && text.substr(0, 2) != to_string(eye)) continue;
      if (landmarks[eye].disc) throw usage_error("--disc " + text + ": that eye has one already");
      landmarks[eye].disc = parse_landmark("--disc", names_eye ? text.substr(3) : text);
    }
  }
  return landmarks;
}

RetinalGrid parse_grid(const Flags& flags) {
  const Eigen::Vector2d size = parse_pair("--size", flags.size, 'x');
  if (size != size.array().floor().matrix()) throw usage_error("--size: pixels are counted in whole numbers");
  RetinalGrid grid;
  grid.width = static_cast<int>(std::min(size.x(), 1e9));
  grid.height = static_cast<int>(std::min(size.y(), 1e9));
  grid.projection = parse_projection(flags);
  if (grid.is_angular()) {
    grid.field_deg = parse_pair("--field-deg", flags.field_deg, 'x');
  } else if (!flags.field_mm.empty()) {
    const Eigen::Vector2d field = parse_pair("--field-mm", flags.field_mm, 'x');
    grid.field_x_mm = field.x();
    grid.field_y_mm = field.y();
  }
  if (!flags.fovea.empty()) grid.centre_mm = parse_landmark("--fovea", flags.fovea).from_pole_mm;
  return grid;
}

TraceSettings parse_settings(const Flags& flags, const CommonOptions& common) {
  TraceSettings settings = flags.options.settings;
  settings.samples = flags.samples.value_or(settings.target_error ? 16384 : settings.samples);
  settings.method = flags.method == "paper" ? Method::paper : Method::pupil;
  settings.vertices = parse_counts("--vertices", flags.vertices);
  if (!flags.surfaces.empty()) settings.representation = parse_representation(flags.surfaces);
  settings.grid = parse_grid(flags);
  settings.seed = common.seed;
  settings.verbosity = common.verbosity;
  return settings;
}

/// One eye's deviation from the point that both look at.
struct Strabismus {
  Laterality eye = Laterality::od;
  Eigen::Vector2d deviation_prism{0, 0};
};

std::optional<Strabismus> parse_strabismus(const std::string& text, LateralityChoice wanted) {
  if (text.empty()) return std::nullopt;
  for (const Laterality eye : both_eyes) {
    if (text.rfind(to_string(eye) + std::string(":"), 0) != 0) continue;
    if (!includes(wanted, eye))
      throw usage_error(std::string("--strabismus: ") + to_string(eye) + " is not traced",
                        "ask for it with --laterality, or for a pair of eyes with --pupillary-distance");
    return Strabismus{eye, parse_pair("--strabismus", text.substr(3), ',')};
  }
  throw usage_error("--strabismus: \"" + text + "\" does not begin with od: or os:", "write os:15,0");
}

/// Where each eye stands and looks.
std::map<Laterality, EyePose> parse_poses(const Flags& flags, LateralityChoice wanted) {
  // A named eye stands for the right one where neither its side nor a pair is asked for.
  const bool is_right =
      !flags.eye.empty() && !flags.options.pupillary_distance_mm && wanted == LateralityChoice::both;
  const auto strabismus = parse_strabismus(flags.strabismus, is_right ? LateralityChoice::od : wanted);
  const Eigen::Vector2d gaze = parse_pair("--gaze", flags.gaze, ',');
  std::map<Laterality, EyePose> poses;
  for (const Laterality eye : both_eyes) {
    EyePose& pose = poses[eye];
    pose.rotation_centre_mm = flags.rotation_centre_mm;
    if (const auto distance_mm = flags.options.pupillary_distance_mm)
      pose.apex_mm.x() = (eye == Laterality::od ? -0.5 : 0.5) * *distance_mm;
    pose.gaze = {gaze.x(), gaze.y()};
    if (flags.fixate.empty()) continue;
    const bool deviates = strabismus && strabismus->eye == eye;
    pose.gaze = gaze_at(pose, parse_point("--fixate", flags.fixate),
                        deviates ? strabismus->deviation_prism : Eigen::Vector2d(0, 0));
  }
  return poses;
}

std::optional<Spectacle> parse_worn(const Flags& flags) {
  if (!flags.spectacle.empty() && !flags.plano_cylinder.empty())
    throw usage_error("--spectacle and --plano-cylinder exclude each other");
  if (!flags.spectacle.empty()) return parse_spectacle(flags.spectacle);
  if (flags.plano_cylinder.empty()) return std::nullopt;
  const Eigen::Vector2d lens = parse_pair("--plano-cylinder", flags.plano_cylinder, '@');
  return PlanoCylinder{lens.x(), lens.y()};
}

std::optional<IrradianceSettings> parse_irradiance(const Flags& flags) {
  if (!flags.luminance_cd_m2) return std::nullopt;
  IrradianceSettings settings;
  settings.luminance_cd_m2 = *flags.luminance_cd_m2;
  settings.age_years = flags.media_age_years ? flags.media_age_years : flags.measured.age_years;
  settings.media_field = flags.media_field == "large" ? MediaField::large : MediaField::small;
  NumbersOf bands("--bands", flags.bands);
  settings.first_nm = bands.number();
  bands.need(':');
  settings.last_nm = bands.number();
  bands.need(':');
  settings.step_nm = bands.number();
  if (!bands.done()) throw usage_error("--bands: \"" + flags.bands + "\" goes on after its third number");
  return settings;
}

TraceOptions parse_options(const Flags& flags, const CommonOptions& common) {
  TraceOptions options = flags.options;
  options.settings = parse_settings(flags, common);
  options.poses = parse_poses(flags, common.laterality);
  options.exposure.eye_motion_deg = parse_pair("--motion", flags.motion, ',');
  options.spectacle = parse_worn(flags);
  options.landmarks = parse_landmarks(flags, eyes_traced(flags, common.laterality));
  options.irradiance = parse_irradiance(flags);
  if (!flags.irradiance_formats.empty())
    options.irradiance_files.formats = {flags.irradiance_formats.begin(), flags.irradiance_formats.end()};
  if (!flags.movement.empty()) options.movie = MovieSettings{flags.movement, flags.frame_rate_hz};
  if (!flags.psf_grid.empty()) {
    const Eigen::Vector2d grid = parse_pair("--psf-grid", flags.psf_grid, ':');
    options.psf_grid = FieldGrid{grid.x(), grid.y()};
  }
  return options;
}

MeasuredEyeOptions parse_measured(const Flags& flags) {
  if (flags.accommodation_D || flags.accommodation_parameter)
    throw usage_error("--accommodation: a measured eye is traced as it was in the scanner",
                      "use it with --eye");
  if (!flags.lens_model.empty() && flags.lens_model != "core" && flags.lens_model != "homogeneous")
    throw usage_error("--lens-model: \"" + flags.lens_model + "\" is unknown", "give homogeneous or core");
  MeasuredEyeOptions measured = flags.measured;
  measured.lens_core = flags.lens_model == "core";
  if (measured.lens_core && measured.lens_index)
    throw usage_error("--lens-index: the lens of --lens-model core has two, Gullstrand's",
                      "give one of them");
  measured.pupil_mm = flags.pupil_mm.value_or(measured.pupil_mm);
  return measured;
}

NamedEye parse_named(const Flags& flags) {
  if (flags.measured.age_years || flags.measured.lens_index || !flags.lens_model.empty() ||
      flags.measured.retinal_depth_mm)
    throw usage_error("--age, --lens-index, --lens-model and --retinal-depth make a measured eye of a case",
                      "leave them out with --eye");
  NamedEye named;
  named.eye = flags.eye;
  named.options.accommodation_D = flags.accommodation_D.value_or(0);
  named.options.accommodation_parameter = flags.accommodation_parameter;
  named.options.pupil_mm = flags.pupil_mm;
  named.output = flags.output;
  return named;
}

Answer run(const Flags& flags, const CommonOptions& common) {
  if (flags.case_folder.empty() == flags.eye.empty())
    throw usage_error(
        flags.eye.empty() ? "neither a case nor --eye is given" : "a case and --eye exclude each other",
        "see emmetrope trace --help");
  if (!flags.eye.empty()) return trace_named(parse_named(flags), parse_options(flags, common), common);
  if (!flags.output.empty())
    throw usage_error("-o: a case's pictures go into the case",
                      "leave -o away, or trace a single eye with --eye CASE/raytrace/od/eye.json -o FILE");
  return trace_case(flags.case_folder, parse_measured(flags), parse_options(flags, common), common);
}

void check_case_options(const Flags& flags, const CommonOptions& common) {
  parse_measured(flags);
  const TraceOptions options = parse_options(flags, common);
  options.check();
  make_scene(options.scene);
}

}  // namespace

Command command() {
  const auto flags = std::make_shared<Flags>();
  Command command;
  command.name = "trace";
  command.summary = "Draws what an eye sees: rays from the retina through the pupil into a scene.";
  command.example =
      "emmetrope trace CASE    or: emmetrope trace --eye navarro --scene letters:logmar=1 -o navarro.png";
  command.declare = [flags](CLI::App& app) { declare(app, *flags); };
  command.run = [flags](const CommonOptions& common) { return run(*flags, common); };
  command.check = [flags](const CommonOptions& common) { check_case_options(*flags, common); };
  command.result_keys = {"pupil_mm",
                         "pupil_position_mm",
                         "pupil_rim_mm",
                         "stiles_crawford_per_mm2",
                         "pupil_magnification",
                         "wavelength_nm",
                         "zernike_um",
                         "rms_um",
                         "higher_order_rms_um",
                         "fit_residual_rms_um",
                         "line_of_sight_deg",
                         "tangential_deg",
                         "spot",
                         "strehl",
                         "vsotf",
                         "mtf",
                         "psf"};
  return command;
}

}  // namespace emmetrope::raytrace
