#include "raytrace/stage.hpp"

#include <fmt/format.h>
#include <algorithm>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "raytrace/command.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

Json summary(const TraceResult& result, const std::string& image) {
  Json states = Json::object();
  for (const auto& [state, count] : result.states) states[to_string(state)] = count;
  Json json{{"rays", result.rays},      {"wall_s", result.wall_s}, {"rays_per_s", result.rays_per_s()},
            {"device", result.device},  {"states", states},        {"image", image},
            {"samples", result.samples}};
  if (result.error) json["standard_error_levels"] = *result.error;
  return json;
}

void warn_of_doubts(const TraceResult& result, const TraceSettings& settings) {
  const auto [darkest, brightest] =
      std::minmax_element(result.image.values.begin(), result.image.values.end());
  if (*brightest - *darkest < 1e-4F)
    spdlog::warn(
        "the picture is blank: what the scene holds lies outside the field or between its pixels' centres, "
        "from which rays start; use a smaller --field-mm, or a coarser logmar for a chart");
  const std::uint64_t stopped = result.states.at(RayState::missed_surface) + result.states.at(RayState::tir);
  if (20 * stopped > result.rays)
    spdlog::warn(
        "{:.0f} % of the rays stop inside the eye: they miss a surface or are totally reflected, and the "
        "picture is made of the rest; emmetrope ray shows where a ray ends",
        100.0 * static_cast<double>(stopped) / static_cast<double>(result.rays));
  if (result.error && *result.error > *settings.target_error)
    spdlog::warn(
        "--target-error {}: the standard error is still {:.3g} after {} rays a pixel; raise --samples",
        *settings.target_error, *result.error, result.samples);
}

std::string line(const std::string& eye, const Json& answer) {
  return fmt::format("{}: {:.1f} million rays in {:.2f} s ({:.1f} million a second), {}\n", eye,
                     answer["rays"].get<double>() / 1e6, answer["wall_s"].get<double>(),
                     answer["rays_per_s"].get<double>() / 1e6, answer["image"].get<std::string>());
}

/// What a pixel is on the retina and, near the picture's middle, as an angle of the scene (paraxial).
Json scale_of(const EyeModel& eye, const TraceSettings& settings) {
  const RetinalGrid& grid = settings.grid;
  const double nodal_mm =
      eye.axial_length_mm() - cardinal_points(eye, eye.reference_wavelength_nm).image_nodal_mm;
  const Eigen::Vector2d pixel_mm(grid.field_x_mm / grid.width, grid.field_y_mm / grid.height);
  const Eigen::Vector2d pixel_arcmin = pixel_mm / nodal_mm / degree * 60;
  return {{"um_per_pixel", {1000 * pixel_mm.x(), 1000 * pixel_mm.y()}},
          {"arcmin_per_pixel", {pixel_arcmin.x(), pixel_arcmin.y()}}};
}

/// At the eye's reference wavelength or the one asked for: wavefront.json, the point spread function psf.tiff
/// and the spot diagram spots.csv.
void write_wavefront(const EyeModel& eye, const TraceSettings& settings, const fs::path& folder) {
  WavefrontSettings wavefront_settings;
  wavefront_settings.wavelength_nm = settings.wavelength_nm;
  wavefront_settings.fovea_mm = settings.grid.centre_mm;
  const Wavefront wavefront = measure_wavefront(eye, wavefront_settings);
  const PointSpread spread = point_spread(wavefront);
  Json json = wavefront_json(wavefront);
  if (spread.wraps) {
    spdlog::warn(
        "psf.tiff is left out: the blur is wider than the largest grid of a point spread function; spots.csv "
        "has the rays");
    json["psf"] = nullptr;
    fs::remove(folder / "psf.tiff");  // of an earlier run
  } else {
    json["psf"] = {{"file", "psf.tiff"}, {"pitch_arcmin", spread.pitch_arcmin}};
    write_tiff(folder / "psf.tiff", {spread.size, spread.size, 1, spread.values});
  }
  write_json(folder / "wavefront.json", json);
  std::string spots = "pupil_x_mm,pupil_y_mm,angle_x_arcmin,angle_y_arcmin,weight\n";
  Eigen::Vector2d mean(0, 0);
  double weight = 0;
  for (const auto& ray : wavefront.rays) mean += ray.weight * ray.slope, weight += ray.weight;
  for (const auto& ray : wavefront.rays) {
    const Eigen::Vector2d angle = (ray.slope - mean / weight) / degree * 60;
    spots += fmt::format("{:.5f},{:.5f},{:.5f},{:.5f},{:.6g}\n", ray.place_mm.x(), ray.place_mm.y(),
                         angle.x(), angle.y(), ray.weight / weight);
  }
  write_file(folder / "spots.csv", spots);
}

/// Where a named eye's picture goes: the path itself, or with two eyes one beside the other.
fs::path output_of(const fs::path& output, Laterality laterality, bool two_eyes) {
  if (!two_eyes) return output;
  if (!output.has_extension()) return output / to_string(laterality);
  fs::path name = output.stem();
  name += std::string("-") + to_string(laterality) + output.extension().string();
  return output.parent_path() / name;
}

/// \throw Error (usage) before any ray is traced
void check_output(const fs::path& output) {
  if (output.empty()) throw usage_error("--eye needs -o: where to write", "add -o FOLDER or -o image.png");
  const std::string ending = output.extension().string();
  const bool known =
      ending.empty() || ending == ".png" || ending == ".exr" || ending == ".tif" || ending == ".tiff";
  if (!known && !fs::is_directory(output))
    throw usage_error("-o: a picture cannot be written as " + ending,
                      "give .png, .exr or .tif (float), or a folder without an ending");
}

/// Writes the picture, and into a folder what belongs to it. Returns the picture's path.
fs::path write_named(const fs::path& output, const EyeModel& eye, const TraceSettings& settings,
                     const LinearImage& picture) {
  const std::string ending = output.extension().string();
  if (ending == ".png") {
    write_png(output, picture);
    return output;
  }
  if (ending == ".exr") {
    write_exr(output, picture);
    return output;
  }
  if (ending == ".tif" || ending == ".tiff") {
    write_tiff(output, picture);
    return output;
  }
  std::error_code fault;
  fs::create_directories(output, fault);
  if (fault) throw output_error("cannot make the folder " + output.string() + ": " + fault.message());
  write_wavefront(eye, settings, output);  // computes first, then files follow one another at once
  write_eye(output / "eye.json", eye);
  write_png(output / "uncorrected.png", picture);
  return output / "uncorrected.png";
}

Json pair_json(const Eigen::Vector2d& pair) { return {pair.x(), pair.y()}; }

Json stage_parameters(const TraceOptions& o, const CommonOptions& common) {
  const auto or_null = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  const TraceSettings settings = read_settings(o);
  const Exposure exposure = read_exposure(o);
  Json gaze_deg = Json::object();
  for (const Laterality eye : both_eyes) {
    const EyePose pose = read_pose(o, eye);
    gaze_deg[to_string(eye)] = {pose.gaze.horizontal_deg, pose.gaze.vertical_deg};
  }
  return {{"scene", o.scene},
          {"surfaces", settings.representation ? Json(to_string(*settings.representation)) : Json(nullptr)},
          {"size", {settings.grid.width, settings.grid.height}},
          {"field_mm", {settings.grid.field_x_mm, settings.grid.field_y_mm}},
          {"fovea_mm", pair_json(settings.grid.centre_mm)},
          {"samples", settings.samples},
          {"target_error", or_null(settings.target_error)},
          {"method", to_string(settings.method)},
          {"pupil_mm", o.measured.pupil_mm},
          {"spectacle", o.spectacle},
          {"plano_cylinder", o.plano_cylinder},
          {"gaze_deg", gaze_deg},
          {"pupillary_distance_mm", or_null(o.pupillary_distance_mm)},
          {"rotation_centre_mm", o.rotation_centre_mm},
          {"motion_deg", pair_json(exposure.eye_motion_deg)},
          {"exposure_steps", exposure.steps},
          {"wavelength_nm", or_null(settings.wavelength_nm)},
          {"achromatic", settings.achromatic},
          {"illuminance", settings.illuminance},
          {"stiles_crawford_per_mm2", settings.stiles_crawford_per_mm2},
          {"diffraction", settings.diffraction},
          {"age_years", or_null(o.measured.age_years)},
          {"lens_index", or_null(o.measured.lens_index)},
          {"lens_core", o.measured.lens_core},
          {"retinal_depth_mm", o.measured.retinal_depth_mm},
          {"seed", common.seed},
          {"laterality", to_string(common.laterality)}};
}

StageVerdict trace_eyes(const fs::path& case_folder, const TraceOptions& options, const CommonOptions& common,
                        const Tracer& tracer, const Scene& scene, const StageVerdict& meshed,
                        StageWorkspace& workspace) {
  TraceSettings settings = read_settings(options);
  StageVerdict verdict = meshed;  // an eye that was not meshed is missing here too
  Json eyes = Json::object();
  for (const Laterality laterality : both_eyes) {
    if (!includes(common.laterality, laterality)) continue;
    if (!fs::exists(case_folder / "meshing" / to_string(laterality) / "biometry.json")) continue;
    const MeasuredEye measured = read_measured_eye(case_folder, laterality, options.measured);
    settings.pose = read_pose(options, laterality);
    const TraceResult result = trace_exposure(tracer, with_spectacle(measured.eye, options), scene, settings,
                                              read_exposure(options));
    for (const auto& note : result.notes) spdlog::info("{}: {}", to_string(laterality), note);
    warn_of_doubts(result, settings);
    const fs::path folder = workspace.folder() / to_string(laterality);
    fs::create_directories(folder);
    write_mesh(folder / "photoreceptors.ply", measured.photoreceptors_in_lps, true);
    // The eye's own, whatever it wears in the picture: a correction starts from them.
    write_json(folder / "eye.json", measured_eye_json(measured, laterality));
    write_png(folder / "uncorrected.png", result.image);
    write_wavefront(measured.eye, settings, folder);
    Json& eye = eyes[to_string(laterality)];
    eye = summary(result, fmt::format("raytrace/{}/uncorrected.png", to_string(laterality)));
    eye["scale"] = scale_of(measured.eye, settings);
    eye["lens_index"] = measured.lens_index;
    eye["lens_index_from"] = measured.lens_source;
    eye["notes"] = result.notes;
  }
  if (eyes.empty() && verdict.status != ExitStatus::no_result)
    throw input_error(case_folder.string() + "/meshing holds no eye that --laterality asks for",
                      "run emmetrope mesh " + case_folder.string());
  workspace.provenance()["eyes"] = eyes;
  return verdict;
}

/// What the stage reads, and nothing else that lies about in the case.
std::vector<StageInput> inputs_of(const fs::path& case_folder, const TraceOptions& options,
                                  const Scene& scene) {
  std::vector<StageInput> inputs;
  const auto add = [&](const std::string& name, const fs::path& file) {
    if (fs::is_regular_file(file)) inputs.push_back({name, file});
  };
  for (const Laterality laterality : both_eyes)
    for (const char* file : {"biometry.json", "cornea_anterior.ply", "cornea_posterior.ply",
                             "lens_anterior.ply", "lens_posterior.ply", "retina.ply"}) {
      const fs::path name = fs::path("meshing") / to_string(laterality) / file;
      add(name.string(), case_folder / name);
    }
  add("case.json", case_folder / "case.json");
  add("scene", options.scene);
  for (std::size_t i = 0; i < scene.files.size(); ++i)
    add(fmt::format("scene file {}", i + 1), scene.files[i]);
  add("spectacle", options.spectacle);
  if (const fs::path spectacle = options.spectacle; spectacle.extension() == ".json") {
    const Json json = read_json(spectacle);
    const Json surfaces = json.is_object() ? json.value("surfaces", Json::array()) : Json::array();
    for (const Json& surface : surfaces)  // their form is checked where they are put before the eye
      if (surface.is_object() && surface.contains("file") && surface["file"].is_string())
        add("spectacle file " + surface["file"].get<std::string>(),
            spectacle.parent_path() / surface["file"].get<std::string>());
  }
  return inputs;
}

}  // namespace

Answer trace_named(const TraceOptions& options, const CommonOptions& common) {
  check_output(options.output);
  const bool two_eyes = options.pupillary_distance_mm && common.laterality == LateralityChoice::both;
  const auto scene = make_scene(options.scene);
  const Tracer tracer(common.device, common.threads);
  Answer answer;
  for (const Laterality laterality : both_eyes) {
    if (!includes(common.laterality, laterality)) continue;
    if (!two_eyes && common.laterality == LateralityChoice::both && laterality == Laterality::os) continue;
    EyeOptions eye_options;
    eye_options.accommodation_D = options.accommodation_D.value_or(0);
    eye_options.accommodation_parameter = options.accommodation_parameter;
    eye_options.pupil_mm = options.pupil_mm;
    eye_options.laterality = laterality;
    const EyeModel eye = with_spectacle(make_eye(options.eye, eye_options), options);
    TraceSettings settings = read_settings(options);
    settings.pose = read_pose(options, laterality);
    const TraceResult result = trace_exposure(tracer, eye, *scene, settings, read_exposure(options));
    for (const auto& note : result.notes) spdlog::info("{}", note);
    warn_of_doubts(result, settings);
    const fs::path image =
        write_named(output_of(options.output, laterality, two_eyes), eye, settings, result.image);
    Json of_eye = summary(result, image.string());
    of_eye["scale"] = scale_of(eye, settings);
    of_eye["gaze_deg"] = {settings.pose.gaze.horizontal_deg, settings.pose.gaze.vertical_deg};
    answer.text += line(eye.name, of_eye);
    if (two_eyes)
      answer.json["eyes"][to_string(laterality)] = of_eye;
    else
      answer.json = of_eye;
  }
  return answer;
}

Answer trace_case(TraceOptions options, const CommonOptions& common) {
  if (options.accommodation_D || options.accommodation_parameter)
    throw usage_error("--accommodation: a measured eye is traced as it was in the scanner",
                      "use it with --eye");
  if (options.pupil_mm) options.measured.pupil_mm = *options.pupil_mm;
  options.settings.verbosity = common.verbosity;
  const fs::path folder = options.case_folder;
  const CaseLock lock(folder, false);
  const StageVerdict meshed = read_verdict(folder, "meshing");
  const Tracer tracer(common.device, common.threads);
  StageSpec spec;
  spec.stage = "raytrace";
  spec.parameters = stage_parameters(options, common);
  const auto scene = make_scene(options.scene);
  spec.inputs = inputs_of(folder, options, *scene);
  spec.uses_opencl = true;
  spec.device = tracer.device_name();
  const StageOutcome outcome = run_stage(folder, spec, common, [&](StageWorkspace& workspace) {
    return trace_eyes(folder, options, common, tracer, *scene, meshed, workspace);
  });
  Answer answer;
  answer.status = outcome.verdict.status;
  const Json eyes = outcome.stage_json.value("eyes", Json::object());
  answer.json = {{"eyes", eyes}, {"skipped", outcome.skipped}};
  for (auto& [name, eye] : answer.json["eyes"].items()) {
    eye["image"] = (folder / eye["image"].get<std::string>()).string();
    answer.text += line(name, eye);
  }
  for (const auto& reason : outcome.verdict.reasons) answer.text += reason + "\n";
  answer.text += describe("raytrace", outcome, common.verbosity);
  return answer;
}

}  // namespace emmetrope::raytrace
