#include "raytrace/stage.hpp"

#include <fmt/format.h>

#include "pipeline/base/case_subject.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/eye_stage.hpp"
#include "pipeline/base/log.hpp"
#include "raytrace/eye_picture.hpp"
#include "raytrace/irradiance_files.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/visual_field.hpp"
#include "raytrace/wavefront_files.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

Json pair_json(const Eigen::Vector2d& pair) { return {pair.x(), pair.y()}; }

template <typename Value>
Json or_null(const std::optional<Value>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json irradiance_json(const IrradianceSettings& settings, const IrradianceFiles& files) {
  return {{"formats", files.formats},
          {"photons", files.photons},
          {"media_field", settings.media_field == MediaField::small ? "small" : "large"},
          {"luminance_cd_m2", settings.luminance_cd_m2},
          {"bands_nm", {settings.first_nm, settings.last_nm, settings.step_nm}},
          {"media_age_years", or_null(settings.age_years)}};
}

Json landmarks_json(const TraceOptions& options) {
  const auto mark = [](const std::optional<Landmark>& given) {
    return given ? Json{given->from_pole_mm.x(), given->from_pole_mm.y(), given->sigma_mm} : Json(nullptr);
  };
  Json json = Json::object();
  for (const auto& [eye, marks] : options.landmarks)
    if (marks.fovea || marks.disc)  // an eye that has none is left out, asked for or not
      json[to_string(eye)] = {{"fovea", mark(marks.fovea)}, {"disc", mark(marks.disc)}};
  return json;
}

Json parameters_of(const TraceOptions& options, const MeasuredEyeOptions& measured,
                   const CommonOptions& common) {
  const TraceSettings& settings = options.settings;
  const bool is_plano_cylinder =
      options.spectacle && std::holds_alternative<PlanoCylinder>(*options.spectacle);
  Json gaze_deg = Json::object();
  for (const auto& [eye, pose] : options.poses)
    gaze_deg[to_string(eye)] = {pose.gaze.horizontal_deg, pose.gaze.vertical_deg};
  return {
      {"scene", options.scene},
      {"surfaces", settings.representation ? Json(to_string(*settings.representation)) : Json(nullptr)},
      {"vertices", settings.vertices},
      {"size", {settings.grid.width, settings.grid.height}},
      {"projection", to_string(settings.grid.projection)},
      {"field_mm",
       settings.grid.is_angular() ? Json(nullptr) : Json{settings.grid.field_x_mm, settings.grid.field_y_mm}},
      {"field_deg", settings.grid.is_angular() ? pair_json(settings.grid.field_deg) : Json(nullptr)},
      {"fovea_mm", pair_json(settings.grid.centre_mm)},
      {"landmarks", landmarks_json(options)},
      {"samples", settings.samples},
      {"target_error", or_null(settings.target_error)},
      {"method", to_string(settings.method)},
      {"pupil_mm", measured.pupil_mm},
      {"spectacle", options.spectacle && !is_plano_cylinder ? to_json(*options.spectacle) : Json(nullptr)},
      {"plano_cylinder", is_plano_cylinder ? to_json(*options.spectacle) : Json(nullptr)},
      {"gaze_deg", gaze_deg},
      {"pupillary_distance_mm", or_null(options.pupillary_distance_mm)},
      {"rotation_centre_mm", options.poses.at(Laterality::od).rotation_centre_mm},
      {"motion_deg", pair_json(options.exposure.eye_motion_deg)},
      {"exposure_steps", options.exposure.steps},
      {"wavelength_nm", or_null(settings.wavelength_nm)},
      {"achromatic", settings.achromatic},
      {"illuminance", settings.illuminance},
      {"stiles_crawford_per_mm2", settings.stiles_crawford_per_mm2},
      {"diffraction", settings.diffraction},
      {"age_years", or_null(measured.age_years)},
      {"lens_index", or_null(measured.lens_index)},
      {"lens_core", measured.lens_core},
      {"retinal_depth_mm", or_null(measured.retinal_depth_mm)},
      {"psf_grid_deg",
       options.psf_grid ? Json{options.psf_grid->reach_deg, options.psf_grid->step_deg} : Json(nullptr)},
      {"movement", options.movie ? Json(options.movie->movement) : Json(nullptr)},
      {"frame_rate_hz", options.movie ? Json(options.movie->frame_rate_hz) : Json(nullptr)},
      {"irradiance",
       options.irradiance ? irradiance_json(*options.irradiance, options.irradiance_files) : Json(nullptr)},
      {"seed", common.seed},
      {"laterality", to_string(common.laterality)}};
}

/// The subject's age where none is given.
IrradianceSettings at_subjects_age(IrradianceSettings settings, const fs::path& case_folder) {
  if (!settings.age_years) settings.age_years = subject_age_years(case_folder);
  return settings;
}

/// What the stage reads, and nothing else that lies about in the case.
class Inputs {
 public:
  void add(const std::string& name, const fs::path& file) {
    if (fs::is_regular_file(file)) inputs.push_back({name, file});
  }

  void add_meshes(const fs::path& case_folder) {
    for (const Laterality eye : both_eyes)
      for (const char* file : {"biometry.json", "optics.json", "cornea_anterior.ply", "cornea_posterior.ply",
                               "lens_anterior.ply", "lens_posterior.ply", "retina.ply"}) {
        const fs::path name = fs::path("meshing") / to_string(eye) / file;
        add(name.string(), case_folder / name);
      }
  }

  /// With the meshes that it names; their form is checked where they are put before the eye.
  void add_surfaces(const fs::path& spectacle) {
    add("spectacle", spectacle);
    const Json json = read_json(spectacle);
    const Json surfaces = json.is_object() ? json.value("surfaces", Json::array()) : Json::array();
    for (const Json& surface : surfaces)
      if (surface.is_object() && surface.contains("file") && surface["file"].is_string())
        add("spectacle file " + surface["file"].get<std::string>(),
            spectacle.parent_path() / surface["file"].get<std::string>());
  }

  std::vector<StageInput> inputs;
};

std::vector<StageInput> inputs_of(const fs::path& case_folder, const TraceOptions& options,
                                  const Scene& scene) {
  Inputs inputs;
  inputs.add_meshes(case_folder);
  inputs.add("case.json", case_folder / "case.json");
  inputs.add("scene", options.scene);
  if (options.movie) inputs.add("movement", options.movie->movement);
  for (std::size_t i = 0; i < scene.files.size(); ++i)
    inputs.add(fmt::format("scene file {}", i + 1), scene.files[i]);
  if (const auto* surfaces = options.spectacle ? std::get_if<SurfacesFile>(&*options.spectacle) : nullptr)
    inputs.add_surfaces(surfaces->file);
  return inputs.inputs;
}

/// A measured eye keeps the accommodation that it had in the scanner.
EyeInState in_scanner(const EyeModel& eye, const TraceOptions& options) {
  return [&](double /*accommodation_D*/, const std::optional<double>& pupil_mm) {
    EyeModel now = eye;
    if (pupil_mm) now.set_stop_diameter(*pupil_mm);
    return options.with_worn(now);
  };
}

/// Writes what one eye sees into its folder.
/// \return what stage.json says of it
Json trace_eye(const MeasuredEye& measured, const UncertainOptics& optics, Laterality eye,
               const TraceOptions& options, const CommonOptions& common, const Tracer& tracer,
               const Scene& scene, const fs::path& folder) {
  const TraceSettings settings = options.settings_of(eye);
  require_on_retina(measured.eye, options.landmarks_of(eye));
  const EyeModel worn = options.with_worn(measured.eye);
  const TraceResult result = trace_exposure(tracer, worn, scene, settings, options.exposure);
  for (const auto& note : result.notes) spdlog::info("{}: {}", to_string(eye), note);
  warn_of_doubts(result, settings);
  fs::create_directories(folder);
  // The eye's own, whatever it wears in the picture: a correction starts from them.
  write_measured_eye(folder, measured, eye);
  write_png(folder / "uncorrected.png", with_cover(result.image, result.unseen));
  write_wavefront(measured.eye, settings, folder);
  const EyeModel turned = fixed_to_head(worn, settings.pose.turned_from_straight());
  const UncertainField uncertain{optics,
                                 [&](const EyeModel& own) {
                                   return fixed_to_head(options.with_worn(own),
                                                        settings.pose.turned_from_straight());
                                 },
                                 common.thread_count()};
  write_visual_field(turned, settings, options.landmarks_of(eye), &uncertain, folder);
  if (options.irradiance)
    write_irradiance(retinal_irradiance(tracer, worn, scene, settings, options.exposure, *options.irradiance),
                     worn, settings, *options.irradiance, options.irradiance_files, folder);
  if (options.psf_grid)
    write_field(turned, *options.psf_grid, wavefront_settings(settings), folder, common.thread_count(),
                common.verbosity);
  if (options.movie)
    write_movie(tracer, in_scanner(measured.eye, options), eye, scene, settings, options.exposure,
                *options.movie, folder);
  Json json =
      picture_json(result, fmt::format("raytrace/{}/uncorrected.png", to_string(eye)), worn, settings);
  json["lens_index"] = measured.lens_index;
  json["lens_index_from"] = measured.lens_source;
  json["notes"] = result.notes;
  return json;
}

}  // namespace

Answer trace_case(const fs::path& case_folder, const MeasuredEyeOptions& measured,
                  const TraceOptions& options, const CommonOptions& common) {
  options.check();
  if (options.movie && make_movement(options.movie->movement, common.seed).accommodates())
    throw usage_error(
        "--movement: a measured eye is traced as it was in the scanner, without accommodation_D",
        "leave that column out, or use --eye");
  const CaseLock lock(case_folder, false);
  const StageVerdict meshed = read_verdict(case_folder, "meshing");
  const std::vector<Laterality> eyes = eyes_with(case_folder, "meshing", "biometry.json", common.laterality);
  if (eyes.empty() && meshed.status != ExitStatus::no_result)
    throw input_error(case_folder.string() + "/meshing holds no eye that --laterality asks for",
                      "run emmetrope mesh " + case_folder.string());
  const Tracer tracer(common.device, common.threads);
  const auto scene = make_scene(options.scene);
  TraceOptions of_subject = options;
  if (options.irradiance) of_subject.irradiance = at_subjects_age(*options.irradiance, case_folder);
  StageSpec spec;
  spec.stage = "raytrace";
  spec.parameters = parameters_of(options, measured, common);
  spec.inputs = inputs_of(case_folder, options, *scene);
  spec.uses_opencl = true;
  spec.device = tracer.device_name();
  const StageOutcome outcome = run_stage(case_folder, spec, common, [&](StageWorkspace& workspace) {
    Json of_eyes = Json::object();
    StageVerdict verdict = work_eye_by_eye(eyes, meshed, [&](Laterality eye) {
      const fs::path optics = case_folder / "meshing" / to_string(eye) / "optics.json";
      if (!fs::exists(optics))
        throw no_result_error("cornea or lens are withheld: light cannot be traced through this eye");
      const MeasuredEye own = read_measured_eye(case_folder, eye, measured);
      if (!own.warning.empty() && of_eyes.empty()) workspace.warn(own.warning);
      of_eyes[to_string(eye)] =
          trace_eye(own, read_uncertain_optics(optics, own.lens_index_sigma, own.eye), eye, of_subject,
                    common, tracer, *scene, workspace.folder() / to_string(eye));
    });
    workspace.provenance()["eyes"] = of_eyes;
    return verdict;
  });
  const Json of_eyes = outcome.stage_json.value("eyes", Json::object());
  return stage_answer(*stage_of_folder("raytrace"), outcome, common,
                      [&](Laterality eye) -> std::optional<EyeAnswer> {
                        if (!of_eyes.contains(to_string(eye))) return std::nullopt;
                        Json json = of_eyes.at(to_string(eye));
                        json["image"] = (case_folder / json["image"].get<std::string>()).string();
                        return EyeAnswer{json, picture_line(to_string(eye), json)};
                      });
}

}  // namespace emmetrope::raytrace
