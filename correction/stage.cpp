#include "correction/stage.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "correction/prescription/sweep.hpp"
#include "correction/prescription/withholding.hpp"
#include "correction/what_if/ablation.hpp"
#include "pipeline/base/case_subject.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/eye_stage.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/base/scratch_folder.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/eye/optics/plausible_eye.hpp"
#include "pipeline/eye/population/population.hpp"
#include "raytrace/case/trace_picture.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/exposure.hpp"

namespace emmetrope::correction {
namespace {

namespace fs = std::filesystem;

Json parameters_of(const CorrectionSettings& settings, const CommonOptions& common) {
  const PrescriptionSettings& p = settings.prescription;
  const PictureSettings& picture = settings.picture;
  return {{"criterion", to_string(p.criterion)},
          {"chart", p.chart},
          {"vertex_distance_mm", p.vertex_distance_mm},
          {"pupil_mm", p.pupil_mm},
          {"wavelength_nm", p.wavelength_nm},
          {"fovea_mm", {p.fovea_mm.x(), p.fovea_mm.y()}},
          {"plano_cylinder_distance_mm", p.plano_cylinder_distance_mm},
          {"plano_cylinder_index", p.plano_cylinder_index},
          {"material", p.spectacle.material.name},
          {"base_D", p.spectacle.base_D ? Json(*p.spectacle.base_D) : Json(nullptr)},
          {"centre_thickness_mm",
           p.spectacle.centre_thickness_mm ? Json(*p.spectacle.centre_thickness_mm) : Json(nullptr)},
          {"lens_diameter_mm", 2 * p.spectacle.semi_diameter_mm},
          {"lens_index_sigma", settings.lens_index_sigma.value_or(usual_lens_index_sigma)},
          {"known", to_json(settings.known)},
          {"ablation_picture", settings.ablation_picture},
          {"age_years", settings.what_if.age_years ? Json(*settings.what_if.age_years) : Json(nullptr)},
          {"iol_target_D", settings.what_if.iol_target_D},
          {"iol_a_constant", settings.what_if.iol_a_constant},
          {"seed", common.seed},
          {"laterality", to_string(common.laterality)},
          {"picture",
           {{"scene", picture.scene},
            {"size", {picture.width, picture.height}},
            {"field_mm", {picture.field_x_mm, picture.field_y_mm}},
            {"centre_mm", {p.fovea_mm.x(), p.fovea_mm.y()}},
            {"samples", picture.samples},
            {"pupil_mm", picture.pupil_mm},
            {"wavelength_nm", picture.wavelength_nm ? Json(*picture.wavelength_nm) : Json(nullptr)},
            {"achromatic", picture.achromatic},
            {"diffraction", picture.diffraction},
            {"illuminance", picture.illuminance},
            {"exposure_steps", picture.exposure_steps},
            {"stiles_crawford_per_mm2", picture.stiles_crawford_per_mm2}}}};
}

/// The lens's index is that of the age at which the eye was traced: at another it would be another eye.
void follow_traced_age(const fs::path& case_folder, const Json& parameters, CorrectionSettings& settings) {
  const std::optional<double> given = settings.what_if.age_years, of_study = subject_age_years(case_folder);
  std::optional<double> traced = of_study;
  if (!traced && parameters.at("age_years").is_number()) traced = parameters.at("age_years").get<double>();
  const double of_index_years = traced.value_or(usual_age_years);
  const bool index_is_told = !parameters.at("lens_index").is_null();
  const bool index_is_of_age = !index_is_told && !parameters.value("lens_core", false);
  if (!of_study && given && index_is_of_age && std::abs(*given - of_index_years) > rounding_of_age_years)
    throw usage_error(
        fmt::format("--age {:g}: the case was traced at {:g} years{}, of which its lens's index is", *given,
                    of_index_years, traced ? "" : ", as no age was known"),
        fmt::format("give it to emmetrope trace: emmetrope trace {} --age {:g}", case_folder.string(),
                    *given));
  if (of_study || !given) settings.what_if.age_years = traced;
  if (!settings.lens_index_sigma)
    settings.lens_index_sigma = index_is_told ? 0 : lens_index_at_age(of_index_years).sigma;
}

/// What the trace stage decided: how its picture was made, and whether the lens index is known.
void follow_trace_stage(const fs::path& case_folder, CorrectionSettings& settings) {
  const Json stage = read_json(case_folder / "raytrace" / "stage.json");
  try {
    const Json& parameters = stage.at("parameters");
    if (const std::string otherwise = raytrace::seen_otherwise(parameters); !otherwise.empty())
      throw usage_error("the case was traced " + otherwise +
                            ": its picture and the one through the best lens would not compare",
                        "trace it again without that; for a picture " + otherwise +
                            ": emmetrope trace --eye " + (case_folder / "raytrace/EYE/eye.json").string());
    PictureSettings& picture = settings.picture;
    picture.wavelength_nm = parameters.contains("wavelength_nm") && parameters.at("wavelength_nm").is_number()
                                ? std::optional(parameters.at("wavelength_nm").get<double>())
                                : std::nullopt;
    picture.achromatic = parameters.value("achromatic", false);
    picture.diffraction = parameters.value("diffraction", false);
    picture.illuminance = parameters.value("illuminance", false);
    picture.exposure_steps = parameters.value("exposure_steps", picture.exposure_steps);
    picture.stiles_crawford_per_mm2 = parameters.value("stiles_crawford_per_mm2", 0.0);
    picture.scene = parameters.at("scene").get<std::string>();
    picture.samples = parameters.at("samples").get<int>();
    picture.pupil_mm = parameters.at("pupil_mm").get<double>();
    const auto pair = [&](const char* key) { return parameters.at(key).get<std::array<double, 2>>(); };
    const auto [width, height] = pair("size");
    picture.width = static_cast<int>(width);
    picture.height = static_cast<int>(height);
    picture.field_x_mm = pair("field_mm")[0];
    picture.field_y_mm = pair("field_mm")[1];
    const Eigen::Vector2d traced_mm(pair("fovea_mm")[0], pair("fovea_mm")[1]);
    if (settings.fovea_mm && *settings.fovea_mm != traced_mm)
      throw usage_error(
          fmt::format(
              "--fovea {:g},{:g}: the case was traced of {:g},{:g}, of which its pictures and wavefront "
              "are",
              settings.fovea_mm->x(), settings.fovea_mm->y(), traced_mm.x(), traced_mm.y()),
          fmt::format("give it to emmetrope trace: emmetrope trace {} --fovea {:g},{:g}",
                      case_folder.string(), settings.fovea_mm->x(), settings.fovea_mm->y()));
    settings.prescription.fovea_mm = traced_mm;
    follow_traced_age(case_folder, parameters, settings);
  } catch (const nlohmann::json::exception& fault) {
    throw input_error(std::string("raytrace/stage.json: ") + fault.what(),
                      "run \"emmetrope trace --force\" on the case");
  }
}

struct EyeResult {
  Prescription prescription;
  PrescriptionUncertainty uncertainty;
  const UncertainOptics* measured = nullptr;  ///< what is known of a measured eye
};

/// What the clinic knows is learnt about the eye as formulas, which then stands for the one that was traced.
std::optional<Calibration> learn_known_data(const raytrace::Tracer& tracer, EyeModel& eye,
                                            UncertainOptics& uncertain, const KnownData& known,
                                            const PrescriptionSettings& settings,
                                            std::vector<std::string>& warnings) {
  if (known.has_instruments()) {
    warnings = learn(uncertain, read_instruments(known.instruments));
    eye = uncertain.model;
  }
  if (!known.refraction) return {};
  const bool is_of_images = uncertain.known.learnt_from().empty();
  Calibration calibration = calibrate(tracer, eye, uncertain, *known.refraction, settings);
  const std::string warning =
      judge_innovation({"the given refraction", calibration.innovation_sigma, "", is_of_images});
  if (!warning.empty()) warnings.push_back(warning);
  eye = uncertain.model;
  return calibration;
}

/// Formulas cannot stand for every eye, and what was meshed is known already.
void check_learnable(const fs::path& case_folder, Laterality eye, const KnownData& known,
                     const EyeModel& traced) {
  const std::string eye_name = to_string(eye);
  const auto give_to_mesh = [&](const std::string& why) {
    return usage_error(eye_name + ": " + why + ", so no further measurement can be added here",
                       "give the measurements to \"emmetrope mesh\" and trace the case again");
  };
  if (!fs::exists(case_folder / "meshing" / eye_name / "optics.json"))
    throw give_to_mesh("meshing/" + eye_name + "/optics.json is missing");
  if (traced.media.find("lens") == traced.media.end())
    throw give_to_mesh("it was traced with a lens of cortex and core");
  const Json meshing = read_json(case_folder / "meshing" / "stage.json");
  const Json::json_pointer topography("/parameters/instruments/" + eye_name + "/topography");
  if (meshing.contains(topography) && !meshing.at(topography).is_null())
    throw give_to_mesh("its cornea has been meshed from a topography");
  const Json meshed = meshing.value(
      Json::json_pointer("/parameters/instruments/" + eye_name + "/measurements"), Json::array());
  const Json given = emmetrope::to_json(std::map<Laterality, EyeInstruments>{{eye, known.instruments}})
                         .at(eye_name)
                         .at("measurements");
  for (const Json& reading : given)
    if (std::find(meshed.begin(), meshed.end(), reading) != meshed.end())
      throw usage_error(fmt::format("{}: that {} was given to \"emmetrope mesh\" already", eye_name,
                                    reading.at("quantity").get<std::string>()),
                        "leave it out: it would count as another reading");
}

raytrace::TraceSettings trace_settings(const PictureSettings& picture, const Eigen::Vector2d& fovea_mm,
                                       std::uint64_t seed) {
  raytrace::TraceSettings trace;
  trace.grid.width = picture.width;
  trace.grid.height = picture.height;
  trace.grid.field_x_mm = picture.field_x_mm;
  trace.grid.field_y_mm = picture.field_y_mm;
  trace.grid.centre_mm = fovea_mm;
  trace.samples = picture.samples;
  trace.wavelength_nm = picture.wavelength_nm;
  trace.achromatic = picture.achromatic;
  trace.diffraction = picture.diffraction;
  trace.illuminance = picture.illuminance;
  trace.stiles_crawford_per_mm2 = picture.stiles_crawford_per_mm2;
  trace.representation =
      raytrace::Representation::analytic;  // the lens; an eye's meshes are patches in it too
  trace.seed = seed;
  trace.verbosity.quiet = true;
  return trace;
}

/// What the eye sees through the sharpest lens, and after an ablation where that is asked for.
void write_pictures(const fs::path& folder, const raytrace::Tracer& tracer, const EyeModel& eye,
                    const Prescription& prescription, const CorrectionSettings& settings,
                    std::uint64_t seed) {
  const PrescriptionSettings& p = prescription.settings;
  const raytrace::TraceSettings trace = trace_settings(settings.picture, p.fovea_mm, seed);
  const EyeModel seeing = with_pupil(eye, settings.picture.pupil_mm);
  const auto scene = raytrace::make_scene(settings.picture.scene);
  raytrace::Exposure exposure;  // of what moves in the scene
  exposure.steps = settings.picture.exposure_steps;
  const auto write_picture = [&](const char* name, const EyeModel& model) {
    raytrace::write_png(folder / name,
                        raytrace::trace_exposure(tracer, model, *scene, trace, exposure).image);
  };
  write_picture("corrected.png",
                thin_lens(p.vertex_distance_mm).before(seeing, as_vector(prescription.refraction)));
  if (!settings.ablation_picture) return;
  const PowerVector at_cornea = move_towards_eye(prescription.refraction, p.vertex_distance_mm);
  try {
    write_picture("ablated.png", with_ablation(seeing, munnerlyn_profile(seeing, at_cornea)));
    write_picture("ablated_wavefront_guided.png",
                  with_ablation(seeing, wavefront_guided_profile(seeing, p.wavelength_nm, p.fovea_mm)));
  } catch (const Error& error) {  // a cornea too thin for it: the prescription stands
    if (error.status() != ExitStatus::no_result) throw;
    spdlog::warn("no picture of an ablation: {}", error.what());
  }
}

void write_eye_files(const fs::path& folder, const raytrace::Tracer& tracer, const EyeModel& eye,
                     const EyeResult& result, const CorrectionSettings& settings, std::uint64_t seed,
                     const std::string& laterality) {
  const PrescriptionSettings& p = result.prescription.settings;
  fs::create_directories(folder);
  Json prescription = to_json(result.prescription, result.uncertainty, laterality);
  prescription["what_if"] =
      what_if_json(eye, p, result.prescription.refraction, settings.what_if, result.measured);
  write_json(folder / "prescription.json", prescription);
  write_file(folder / "sweep.csv", sweep_csv(result.prescription.plano_cylinder));
  write_file(folder / "sweep.svg", sweep_svg(result.prescription.plano_cylinder, p.criterion));
  write_pictures(folder, tracer, eye, result.prescription, settings, seed);
}

std::string summary(const std::string& who, const EyeResult& result) {
  const Prescription& p = result.prescription;
  const Eigen::Vector3d sigma = result.uncertainty.covariance.diagonal().cwiseSqrt();
  const Measured M = Measured::from_sigma(p.refraction.M_D, sigma[0], result.uncertainty.origins[0]);
  const std::string contradiction = contradiction_in(result.uncertainty);
  if (!contradiction.empty()) return fmt::format("{}: no prescription. {}\n", who, contradiction);
  const std::string withheld = reason_to_withhold(M);
  const std::string doubt = withheld.empty() ? reason_not_to_dispense(M) : withheld;
  const auto shown = [](double power_D) { return without_negative_zero(power_D, 2); };
  const std::string line = fmt::format(
      "{}: {}{} at {:g} mm (M {:+.2f} +-{:.2f}, J0 {:+.2f} +-{:.2f}, J45 {:+.2f} +-{:.2f} D, 95 %)\n", who,
      withheld.empty() ? "" : "no prescription, an estimate for information: ",
      format_refraction(round_refraction(p.refraction).refraction), p.settings.vertex_distance_mm,
      shown(p.refraction.M_D), 1.96 * sigma[0], shown(p.refraction.J0_D), 1.96 * sigma[1],
      shown(p.refraction.J45_D), 1.96 * sigma[2]);
  return doubt.empty() ? line : line + "  " + doubt + "\n";
}

/// What the searches leave to be said.
std::vector<std::string> doubts(const Prescription& prescription) {
  std::vector<std::string> sentences;
  const SearchResult& plano = prescription.plano_cylinder.search;
  if (!plano.accepted) sentences.push_back("no plano-cylinder: " + plano.reason);
  if (prescription.search.optima.size() > 1)
    sentences.emplace_back(
        "more than one lens makes a locally sharpest image; see search.distinct_optima_D in "
        "prescription.json");
  constexpr double usual_nm = 589.3, most_off_nm = 50;  // 0.2 D
  if (std::abs(prescription.settings.wavelength_nm - usual_nm) > most_off_nm)
    sentences.push_back(fmt::format("the prescription is of light of {:g} nm, not of {:g} as refractions are",
                                    prescription.settings.wavelength_nm, usual_nm));
  return sentences;
}

/// What `write_eye_files` may write.
constexpr std::array eye_files{"prescription.json", "corrected.png", "sweep.csv",
                               "sweep.svg",         "ablated.png",   "ablated_wavefront_guided.png"};

/// Files are written inside the output's folder, to be moved into it together.
class WholeOutput {
 public:
  explicit WholeOutput(const fs::path& output) : output_(output), scratch_(output / ".writing-correction") {}

  const fs::path& folder() const { return scratch_.path(); }
  /// Puts what has been written, or nothing, in the place of an earlier eye's files.
  void publish() const {
    const auto together = hold_interrupts();
    for (const char* name : eye_files) {
      if (fs::exists(folder() / name))
        fs::rename(folder() / name, output_ / name);
      else
        fs::remove(output_ / name);
    }
  }

 private:
  fs::path output_;
  ScratchFolder scratch_;
};

/// What each eye is corrected from.
std::vector<StageInput> inputs_of(const fs::path& case_folder, const std::vector<Laterality>& eyes,
                                  const std::map<Laterality, KnownData>& known) {
  std::vector<StageInput> inputs;
  for (const Laterality eye : eyes) {
    const std::string name = to_string(eye);
    const auto data = known.find(eye);
    if (data != known.end() && data->second.instruments.topography)
      inputs.push_back({"topography/" + name, data->second.instruments.topography->file});
    for (const char* stage : {"meshing/", "raytrace/"})
      for (const StageInput& input : inputs_below(case_folder, stage + name)) inputs.push_back(input);
  }
  return inputs;
}

/// The eye that was traced, its uncertainty where it was measured, and what the clinic knows of it learnt.
struct KnownEye {
  EyeModel eye;
  std::optional<UncertainOptics> uncertain;
  std::optional<Calibration> calibration;
};

KnownEye read_known_eye(const fs::path& case_folder, Laterality side, const CorrectionSettings& settings,
                        const raytrace::Tracer& tracer, StageWorkspace& workspace) {
  const auto warn = [&](const std::string& text) {
    workspace.warn(std::string(clinical_name(side)) + ": " + text);
  };
  KnownEye known{read_eye(case_folder / "raytrace" / to_string(side) / "eye.json"), {}, {}};
  const fs::path optics = case_folder / "meshing" / to_string(side) / "optics.json";
  if (fs::exists(optics))
    known.uncertain = read_uncertain_optics(optics, settings.lens_index_sigma.value(), known.eye);
  const auto data = settings.known.find(side);
  if (data == settings.known.end()) return known;
  std::vector<std::string> warnings;
  try {
    known.calibration =
        learn_known_data(tracer, known.eye, *known.uncertain, data->second, settings.prescription, warnings);
  } catch (const Error& error) {
    if (error.status() == ExitStatus::no_result) throw;  // told as the eye's reason
    throw said_of(side, error);
  }
  for (const std::string& warning : warnings) warn(warning);
  warn(std::string(
           "what was measured elsewhere is in the prescription and in corrected.png, not in the meshes, "
           "wavefront.json and uncorrected.png") +
       (data->second.has_instruments()
            ? "; give readings of instruments to the mesh stage to have them there too"
            : ""));
  return known;
}

EyeResult correct_one(const KnownEye& known, const raytrace::Tracer& tracer,
                      const PrescriptionSettings& settings) {
  EyeResult result;
  result.prescription = prescribe(tracer, known.eye, settings);
  if (known.uncertain) result.measured = &*known.uncertain;
  result.uncertainty = uncertainty_of(result.prescription, result.measured, known.calibration);
  return result;
}

}  // namespace

void PictureSettings::check() const {
  check_setting("picture.width", width, {1, 100000});
  check_setting("picture.height", height, {1, 100000});
  check_setting("picture.field_x_mm", field_x_mm, {1e-3, 30}, " mm");
  check_setting("picture.field_y_mm", field_y_mm, {1e-3, 30}, " mm");
  check_setting("--samples (picture.samples)", samples, {1, 100000});
  check_setting("picture.pupil_mm", pupil_mm, iris_aperture_mm, " mm");
}

void CorrectionSettings::check() const {
  prescription.check();
  picture.check();
  if (lens_index_sigma) check_setting("--lens-index-sigma (lens_index_sigma)", *lens_index_sigma, {0, 0.05});
  if (what_if.age_years)
    check_setting("--age (what_if.age_years)", *what_if.age_years, human_age_years, " years");
  check_setting("--iol-target (what_if.iol_target_D)", what_if.iol_target_D, {-10, 5}, " D");
  check_setting("--iol-a-constant (what_if.iol_a_constant)", what_if.iol_a_constant, {110, 125});
}

Answer correct_case(const fs::path& case_folder, CorrectionSettings settings, const CommonOptions& common) {
  settings.check();
  const CaseLock lock(case_folder, false);
  const StageVerdict traced = read_verdict(case_folder, "raytrace");
  const std::optional<double> given_years = settings.what_if.age_years;
  const std::string warning_of_age = age_warning(subject_age_years(case_folder), given_years);
  follow_trace_stage(case_folder, settings);
  const std::vector<Laterality> eyes = eyes_with(case_folder, "raytrace", "eye.json", common.laterality);
  if (eyes.size() > 1 && settings.prescription.fovea_mm.x() != 0)
    throw usage_error(fmt::format("--fovea {:g},{:g}: +x is nasal in a right eye and temporal in a left one",
                                  settings.prescription.fovea_mm.x(), settings.prescription.fovea_mm.y()),
                      "correct one eye, with --laterality od or os");
  if (eyes.empty() && traced.status == ExitStatus::done)
    throw input_error((case_folder / "raytrace").string() + " holds no eye that --laterality asks for",
                      "trace it with: emmetrope trace " + case_folder.string());
  for (const Laterality eye : eyes)
    if (settings.known.count(eye) > 0)
      check_learnable(case_folder, eye, settings.known.at(eye),
                      read_eye(case_folder / "raytrace" / to_string(eye) / "eye.json"));
  StageSpec spec;
  spec.stage = "correction";
  spec.parameters = parameters_of(settings, common);
  spec.parameters["age_given_years"] = given_years ? Json(*given_years) : Json(nullptr);
  spec.inputs = inputs_of(case_folder, eyes, settings.known);
  spec.uses_opencl = true;
  std::optional<raytrace::Tracer> tracer;
  if (!eyes.empty()) {
    tracer.emplace(common.device, common.threads);
    spec.device = tracer->device_name();
  }

  std::map<Laterality, std::string> summaries;
  const StageOutcome outcome = run_stage(case_folder, spec, common, [&](StageWorkspace& workspace) {
    if (!warning_of_age.empty()) workspace.warn(warning_of_age);
    for (const auto& [side, data] : settings.known)
      if (std::find(eyes.begin(), eyes.end(), side) == eyes.end()) workspace.warn(readings_not_used(side));
    return work_eye_by_eye(eyes, traced, [&](Laterality side) {
      const KnownEye known = read_known_eye(case_folder, side, settings, *tracer, workspace);
      const EyeResult result = correct_one(known, *tracer, settings.prescription);
      write_eye_files(workspace.folder() / to_string(side), *tracer, known.eye, result, settings, common.seed,
                      to_string(side));
      for (const std::string& doubt : doubts(result.prescription))
        workspace.warn(std::string(clinical_name(side)) + ": " + doubt);
      summaries[side] = summary(clinical_name(side), result);
    });
  });
  Answer answer = stage_answer(
      *stage_of_folder("correction"), outcome, common, [&](Laterality eye) -> std::optional<EyeAnswer> {
        const fs::path file = case_folder / "correction" / to_string(eye) / "prescription.json";
        if (!fs::exists(file)) return std::nullopt;
        return EyeAnswer{read_json(file), summaries[eye]};
      });
  answer.text += research_notice + std::string("\n");
  return answer;
}

Answer correct_eye(const EyeModel& eye, const fs::path& output, CorrectionSettings settings,
                   const CommonOptions& common) {
  settings.check();
  settings.prescription.fovea_mm = settings.fovea_mm.value_or(Eigen::Vector2d(0, 0));
  if (!settings.known.empty())
    throw usage_error("measurements from elsewhere are learnt about a measured eye; --eye is known exactly",
                      "leave them out, or name a CASE");
  if (settings.lens_index_sigma)
    throw usage_error("--lens-index-sigma (lens_index_sigma) is of a measured eye; --eye is known exactly",
                      "leave it out, or name a CASE");
  if (const std::string doubt = implausible_eye(eye); !doubt.empty()) spdlog::warn("{}", doubt);
  raytrace::make_scene(settings.picture.scene);  // where that fails, or the folder, at once
  const WholeOutput whole(output);
  const raytrace::Tracer tracer(common.device, common.threads);
  EyeResult result;
  try {
    result.prescription = prescribe(tracer, eye, settings.prescription);
  } catch (const Error& error) {
    if (error.status() == ExitStatus::no_result) whole.publish();  // an earlier eye's lens is not this one's
    throw;
  }
  result.uncertainty = uncertainty_of(result.prescription, nullptr);
  write_eye_files(whole.folder(), tracer, eye, result, settings, common.seed, "");
  whole.publish();
  for (const std::string& doubt : doubts(result.prescription)) spdlog::warn("{}: {}", eye.name, doubt);
  Answer answer;
  answer.json = read_json(output / "prescription.json");
  answer.text = summary(eye.name, result) + std::string(research_notice) + "\n";
  return answer;
}

}  // namespace emmetrope::correction
