#include "raytrace/named_eye.hpp"

#include "pipeline/base/error.hpp"
#include "pipeline/base/eye_stage.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/eye/optics/plausible_eye.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/eye_picture.hpp"
#include "raytrace/irradiance_files.hpp"
#include "raytrace/picture/float_files.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/visual_field.hpp"
#include "raytrace/wavefront_files.hpp"

namespace emmetrope::raytrace {
namespace {

namespace fs = std::filesystem;

/// A picture by itself. What is there as a folder is one, whatever its name.
bool is_picture(const fs::path& output) { return output.has_extension() && !fs::is_directory(output); }

/// Where a named eye's picture goes: the path itself, or with two eyes one beside the other.
fs::path output_of(const fs::path& output, Laterality laterality, bool two_eyes) {
  if (!two_eyes) return output;
  if (!is_picture(output)) return output / to_string(laterality);
  fs::path name = output.stem();
  name += std::string("-") + to_string(laterality) + output.extension().string();
  return output.parent_path() / name;
}

/// Writes the picture, and into a folder what belongs to it.
/// \return the picture's path
fs::path write_output(const fs::path& output, const EyeModel& eye, const TraceSettings& settings,
                      const Landmarks& landmarks, const TraceOptions& options, const CommonOptions& common,
                      const LinearImage& picture, std::optional<RetinalIrradiance> light) {
  const std::string ending = is_picture(output) ? output.extension().string() : "";
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
  const EyeModel turned = fixed_to_head(eye, settings.pose.turned_from_straight());
  if (options.psf_grid)
    write_field(turned, *options.psf_grid, wavefront_settings(settings), output, common.thread_count(),
                common.verbosity);
  else
    remove_field(output);
  // What takes long comes first, then files follow one another at once.
  write_wavefront(turned, settings, output);
  write_visual_field(turned, settings, landmarks, nullptr, output);
  if (light)
    write_irradiance(std::move(*light), eye, settings, *options.irradiance, options.irradiance_files, output);
  else
    remove_irradiance(output);
  if (!options.movie) remove_movie(output);
  write_eye(output / "eye.json", eye);
  write_png(output / "uncorrected.png", picture);
  return output / "uncorrected.png";
}

/// \param usual  of the eye at rest
EyeInState in_state(const NamedEye& named, const EyeOptions& usual, const TraceOptions& options) {
  return [&named, usual, &options](double accommodation_D, const std::optional<double>& pupil_mm) {
    EyeOptions now = usual;
    now.accommodation_D = accommodation_D;
    if (pupil_mm) now.pupil_mm = pupil_mm;
    return options.with_worn(make_eye(named.eye, now));
  };
}

std::vector<Laterality> eyes_of(const TraceOptions& options, LateralityChoice wanted) {
  if (wanted == LateralityChoice::both && !options.pupillary_distance_mm) return {Laterality::od};
  return eyes_asked_for(wanted);
}

}  // namespace

void NamedEye::check() const {
  if (output.empty()) throw usage_error("--eye needs -o: where to write", "add -o FOLDER or -o image.png");
  const std::string ending = output.extension().string();
  const bool known = ending == ".png" || ending == ".exr" || ending == ".tif" || ending == ".tiff";
  if (is_picture(output) && !known)
    throw usage_error("-o: a picture cannot be written as " + ending,
                      "give .png, .exr or .tif (float), or a folder without an ending");
}

Answer trace_named(const NamedEye& named, const TraceOptions& options, const CommonOptions& common) {
  named.check();
  options.check();
  if (is_picture(named.output)) {
    if (options.psf_grid || options.irradiance || options.movie)
      throw usage_error("--psf-grid, --irradiance and --movement write several files", "give -o a folder");
    for (const auto& [eye, marks] : options.landmarks)
      if (marks.disc || (marks.fovea && marks.fovea->sigma_mm > 0))
        throw usage_error("--disc and the +- of --fovea are for visual-field.json, beside the picture",
                          "give -o a folder");
  }
  const auto scene = make_scene(options.scene);
  const Tracer tracer(common.device, common.threads);
  const std::vector<Laterality> eyes = eyes_of(options, common.laterality);
  const bool two_eyes = eyes.size() == 2;
  Answer answer;
  for (const Laterality laterality : eyes) {
    EyeOptions eye_options = named.options;
    eye_options.laterality = laterality;
    const EyeModel eye = options.with_worn(make_eye(named.eye, eye_options));
    if (const std::string doubt = implausible_eye(eye); !doubt.empty()) spdlog::warn("{}", doubt);
    const TraceSettings settings = options.settings_of(laterality);
    // What cannot be is said before anything takes long.
    require_on_retina(eye, options.landmarks_of(laterality));
    if (options.movie)
      require_states(in_state(named, eye_options, options), options.movie->movement, settings.seed);
    const TraceResult result = trace_exposure(tracer, eye, *scene, settings, options.exposure);
    for (const auto& note : result.notes) spdlog::info("{}", note);
    warn_of_doubts(result, settings);
    std::optional<RetinalIrradiance> light;
    if (options.irradiance)
      light = retinal_irradiance(tracer, eye, *scene, settings, options.exposure, *options.irradiance);
    const fs::path output = output_of(named.output, laterality, two_eyes);
    const fs::path image = write_output(output, eye, settings, options.landmarks_of(laterality), options,
                                        common, with_cover(result.image, result.unseen), std::move(light));
    if (options.movie)
      write_movie(tracer, in_state(named, eye_options, options), laterality, *scene, settings,
                  options.exposure, *options.movie, output);
    Json of_eye = picture_json(result, image.string(), eye, settings);
    of_eye["gaze_deg"] = {settings.pose.gaze.horizontal_deg, settings.pose.gaze.vertical_deg};
    answer.text += picture_line(eye.name, of_eye);
    if (two_eyes)
      answer.json["eyes"][to_string(laterality)] = of_eye;
    else
      answer.json = of_eye;
  }
  return answer;
}

}  // namespace emmetrope::raytrace
