#include "correction/stage.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

#include "correction/what_if/ablation.hpp"
#include "pipeline/base/notation.hpp"
#include "correction/search/sweep.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/interrupt.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/version.hpp"
#include "raytrace/spectacle/spectacle.hpp"

namespace emmetrope::correction {
namespace {

namespace fs = std::filesystem;

constexpr double lens_index_prior_sigma = 0.005;

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
          {"lens_index_sigma", settings.lens_index_sigma.value_or(lens_index_prior_sigma)},
          {"instruments", to_json(settings.known.instruments)},
          {"known_refractions", settings.known.refractions},
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
            {"centre_mm", {picture.centre_mm.x(), picture.centre_mm.y()}},
            {"samples", picture.samples},
            {"pupil_mm", picture.pupil_mm}}}};
}

/// "500x500", "6x6", "0,0": two numbers of the trace stage's parameters.
std::array<double, 2> two_numbers(const Json& parameters, const char* key, char separator) {
  const auto text = parameters.at(key).get<std::string>();
  const auto middle = text.find(separator);
  std::array<double, 2> numbers{};
  const auto read = [&](std::string_view part, double& number) {
    return std::from_chars(part.data(), part.data() + part.size(), number).ec == std::errc();
  };
  if (middle == std::string::npos || !read(std::string_view(text).substr(0, middle), numbers[0]) ||
      !read(std::string_view(text).substr(middle + 1), numbers[1]))
    throw input_error("raytrace/stage.json: parameter \"" + std::string(key) + "\" is \"" + text + "\"",
                      "run \"emmetrope trace --force\" on the case");
  return numbers;
}

/// What the trace stage decided: how its picture was made, and whether the lens index is known.
void follow_trace_stage(const fs::path& case_folder, CorrectionSettings& settings) {
  const Json stage = read_json(case_folder / "raytrace" / "stage.json");
  try {
    const Json& parameters = stage.at("parameters");
    PictureSettings& picture = settings.picture;
    picture.scene = parameters.at("scene").get<std::string>();
    picture.samples = parameters.at("samples").get<int>();
    picture.pupil_mm = parameters.at("pupil_mm").get<double>();
    const auto size = two_numbers(parameters, "size", 'x'),
               field_mm = two_numbers(parameters, "field_mm", 'x');
    const auto fovea_mm = two_numbers(parameters, "fovea", ',');
    picture.width = static_cast<int>(size[0]);
    picture.height = static_cast<int>(size[1]);
    picture.field_x_mm = field_mm[0];
    picture.field_y_mm = field_mm[1];
    picture.centre_mm = {fovea_mm[0], fovea_mm[1]};
    if (settings.prescription.fovea_mm.isZero()) settings.prescription.fovea_mm = picture.centre_mm;
    if (!parameters.at("lens_index").is_null() && !settings.lens_index_sigma) settings.lens_index_sigma = 0;
    if (!settings.what_if.age_years && parameters.at("age_years").is_number())
      settings.what_if.age_years = parameters.at("age_years").get<double>();
  } catch (const nlohmann::json::exception& fault) {
    throw input_error(std::string("raytrace/stage.json: ") + fault.what(),
                      "run \"emmetrope trace --force\" on the case");
  }
}

struct EyeResult {
  Prescription prescription;
  PrescriptionUncertainty uncertainty;
  std::optional<double> axial_length_mm;  ///< optical, of a measured eye
};

/// What the clinic knows is learnt about the eye as formulas, which then stands for the one that was traced.
std::optional<Calibration> learn_known_data(const raytrace::Tracer& tracer, EyeModel& eye,
                                            UncertainEye& uncertain, const KnownData& known,
                                            const PrescriptionSettings& settings,
                                            std::vector<std::string>& warnings) {
  if (known.has_instruments()) {
    warnings = learn(uncertain, read_instruments(known.instruments));
    eye = uncertain.eye;
  }
  if (!known.refraction) return {};
  Calibration calibration = calibrate(tracer, eye, uncertain, *known.refraction, settings);
  if (calibration.surprise_sigma > surprising_sigma)
    warnings.push_back(fmt::format(
        "the given refraction and the images differ by {:.1f} standard deviations; check its eye and "
        "its sign",
        calibration.surprise_sigma));
  eye = uncertain.eye;
  return calibration;
}

/// Formulas cannot stand for every eye.
void check_learnable(const fs::path& case_folder, const std::string& eye_name, const EyeModel& traced) {
  const auto give_to_mesh = [&](const std::string& why) {
    return usage_error(eye_name + ": " + why + ", so no further measurement can be added here",
                       "give the measurements to \"emmetrope mesh\" and trace the case again");
  };
  if (!fs::exists(case_folder / "meshing" / eye_name / "optics.json"))
    throw give_to_mesh("meshing/" + eye_name + "/optics.json is missing");
  if (traced.media.find("lens") == traced.media.end())
    throw give_to_mesh("it was traced with a lens of cortex and core");
  const Json meshing = read_json(case_folder / "meshing" / "stage.json");
  for (const Json& map : meshing.at("parameters").value("topography", Json::array()))
    if (map.get<std::string>().rfind(eye_name + ":", 0) == 0)
      throw give_to_mesh("its cornea has been meshed from a topography");
}

void write_eye_files(const fs::path& folder, const raytrace::Tracer& tracer, const EyeModel& eye,
                     const EyeResult& result, const CorrectionSettings& settings, std::uint64_t seed,
                     const std::string& laterality) {
  const PrescriptionSettings& p = result.prescription.settings;
  const PictureSettings& picture = settings.picture;
  fs::create_directories(folder);
  Json prescription = to_json(result.prescription, result.uncertainty, laterality);
  WhatIfSettings what_if = settings.what_if;
  what_if.axial_length_mm = result.axial_length_mm;
  prescription["what_if"] = what_if_json(eye, p, result.prescription.refraction, what_if);
  write_json(folder / "prescription.json", prescription);
  write_file(folder / "sweep.csv", sweep_csv(result.prescription.plano_cylinder));
  write_file(folder / "sweep.svg", sweep_svg(result.prescription.plano_cylinder, p.criterion));
  raytrace::TraceSettings trace;
  trace.grid = {picture.width, picture.height, picture.field_x_mm, picture.field_y_mm, picture.centre_mm};
  trace.samples = picture.samples;
  trace.representation =
      raytrace::Representation::analytic;  // the lens; an eye's meshes are patches in it too
  trace.seed = seed;
  trace.verbosity.quiet = true;
  const EyeModel seeing = with_pupil(eye, picture.pupil_mm);
  const auto scene = raytrace::make_scene(picture.scene);
  const auto write_picture = [&](const char* name, const EyeModel& model) {
    raytrace::write_png(folder / name, tracer.trace(model, *scene, trace).image);
  };
  write_picture("corrected.png",
                with_thin_lens(seeing, result.prescription.refraction, p.vertex_distance_mm));
  if (settings.ablation_picture) {
    const PowerVector at_cornea = move_towards_eye(result.prescription.refraction, p.vertex_distance_mm);
    try {
      write_picture("ablated.png", with_ablation(seeing, munnerlyn_profile(seeing, at_cornea)));
      write_picture("ablated_wavefront_guided.png",
                    with_ablation(seeing, wavefront_guided_profile(seeing, p.wavelength_nm, p.fovea_mm)));
    } catch (const Error& error) {  // a cornea too thin for it: the prescription stands
      if (error.status() != ExitStatus::no_result) throw;
      spdlog::warn("no picture of an ablation: {}", error.what());
    }
  }
}

std::string summary(const std::string& who, const EyeResult& result) {
  const Prescription& p = result.prescription;
  const Eigen::Vector3d sigma = result.uncertainty.covariance.diagonal().cwiseSqrt();
  return fmt::format(
      "{}: {} at {:g} mm (M {:+.2f} +-{:.2f}, J0 {:+.2f} +-{:.2f}, J45 {:+.2f} +-{:.2f} D, 95 %)\n", who,
      format_refraction(round_refraction(p.refraction).refraction), p.settings.vertex_distance_mm,
      p.refraction.M_D, 1.96 * sigma[0], p.refraction.J0_D, 1.96 * sigma[1], p.refraction.J45_D,
      1.96 * sigma[2]);
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
  return sentences;
}

/// The lens index of a measured eye that was traced is the one to be uncertain about.
UncertainEye read_uncertain_eye(const fs::path& file, double lens_index_sigma, const EyeModel& traced) {
  UncertainEye uncertain = uncertain_eye_from_json(read_json(file), file.parent_path(), lens_index_sigma);
  const auto lens = traced.media.find("lens");
  if (lens == traced.media.end()) return uncertain;  // cortex and core: the equivalent index stays
  const double index = lens->second.index;
  const Eigen::Index i = uncertain.index_of("lens_index");
  uncertain.numbers.mean[i] = index;
  uncertain.numbers.covariance.row(i).setZero();
  uncertain.numbers.covariance.col(i).setZero();
  uncertain.numbers.covariance(i, i) = lens_index_sigma * lens_index_sigma;
  uncertain.eye.media.at("lens").index = index;
  return uncertain;
}

/// What `write_eye_files` may write.
constexpr std::array eye_files{"prescription.json", "corrected.png", "sweep.csv",
                               "sweep.svg",         "ablated.png",   "ablated_wavefront_guided.png"};

/// A folder inside the output in which files are written, to be moved out of it together; it goes again,
/// whatever happens.
class WholeOutput {
 public:
  explicit WholeOutput(fs::path output) : output_(std::move(output)), guard_(folder()) {
    std::error_code fault;
    fs::remove_all(folder(), fault);
    fs::create_directories(folder(), fault);
    if (fault) throw output_error("cannot make the folder " + output_.string() + ": " + fault.message());
  }
  ~WholeOutput() {
    std::error_code ignored;
    fs::remove_all(folder(), ignored);
  }
  WholeOutput(const WholeOutput&) = delete;
  WholeOutput& operator=(const WholeOutput&) = delete;

  fs::path folder() const { return output_ / ".writing-correction"; }
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
  RemoveOnInterrupt guard_;
};

}  // namespace

Answer correct_case(const fs::path& case_folder, CorrectionSettings settings, const CommonOptions& common) {
  const CaseLock lock(case_folder, false);
  const StageVerdict traced = read_verdict(case_folder, "raytrace");
  follow_trace_stage(case_folder, settings);
  if (!settings.what_if.age_years && fs::exists(case_folder / "case.json")) {
    const Json subject = read_json(case_folder / "case.json").value("subject", Json::object());
    if (subject.contains("age_years") && subject["age_years"].is_number())
      settings.what_if.age_years = subject["age_years"].get<double>();
  }
  const std::map<Laterality, KnownData> known = parse_known_data(settings.known);
  std::vector<Laterality> eyes;
  StageSpec spec{"correction", parameters_of(settings, common), {}, true, {}};
  for (const Laterality eye : both_eyes) {
    const std::string name = to_string(eye);
    if (!includes(common.laterality, eye) || !fs::exists(case_folder / "raytrace" / name / "eye.json"))
      continue;
    eyes.push_back(eye);
    if (const auto data = known.find(eye); data != known.end()) {
      check_learnable(case_folder, name, read_eye(case_folder / "raytrace" / name / "eye.json"));
      if (const auto& map = data->second.instruments.topography)
        spec.inputs.push_back({"topography/" + name, map->file});
    }
    for (const char* stage : {"meshing/", "raytrace/"})
      for (const StageInput& input : inputs_below(case_folder, stage + name)) spec.inputs.push_back(input);
  }
  if (eyes.empty() && traced.status == ExitStatus::done)
    throw input_error((case_folder / "raytrace").string() + " holds no eye that --laterality asks for",
                      "trace it with: emmetrope trace " + case_folder.string());
  std::optional<raytrace::Tracer> tracer;
  if (!eyes.empty()) {
    tracer.emplace(common.device, common.threads);
    spec.device = tracer->device_name();
  }

  std::string text;
  Json answers = Json::object();
  const auto work = [&](StageWorkspace& workspace) {
    StageVerdict verdict;
    verdict.reasons = traced.reasons;
    for (const auto& [side, data] : known)
      if (std::find(eyes.begin(), eyes.end(), side) == eyes.end())
        workspace.warn(std::string(clinical_name(side)) +
                       ": what was measured of it elsewhere is not used: this run does not work on that eye");
    std::size_t done = 0;
    for (const Laterality side : eyes) {
      const std::string name = to_string(side);
      try {
        EyeModel eye = read_eye(case_folder / "raytrace" / name / "eye.json");
        const fs::path optics = case_folder / "meshing" / name / "optics.json";
        std::optional<UncertainEye> uncertain;
        if (fs::exists(optics))
          uncertain =
              read_uncertain_eye(optics, settings.lens_index_sigma.value_or(lens_index_prior_sigma), eye);
        std::optional<Calibration> calibration;
        if (const auto data = known.find(side); data != known.end()) {
          std::vector<std::string> warnings;
          calibration =
              learn_known_data(*tracer, eye, *uncertain, data->second, settings.prescription, warnings);
          for (const std::string& warning : warnings)
            workspace.warn(std::string(clinical_name(side)) + ": " + warning);
          workspace.warn(
              std::string(clinical_name(side)) +
              ": what was measured elsewhere is in the prescription and in corrected.png, not in the "
              "meshes and uncorrected.png; give it to the mesh stage to have it there too");
        }
        EyeResult result{prescribe(*tracer, eye, settings.prescription), {}, {}};
        if (uncertain)
          result.axial_length_mm = uncertain->numbers.mean[uncertain->index_of("optical_axial_length_mm")];
        result.uncertainty =
            uncertainty_of(result.prescription, uncertain ? &*uncertain : nullptr, calibration);
        write_eye_files(workspace.folder() / name, *tracer, eye, result, settings, common.seed, name);
        for (const std::string& doubt : doubts(result.prescription))
          workspace.warn(std::string(clinical_name(side)) + ": " + doubt);
        text += summary(clinical_name(side), result);
        ++done;
      } catch (const Error& error) {
        if (error.status() != ExitStatus::no_result) throw;
        verdict.reasons.push_back(std::string(clinical_name(side)) + ": " + error.what());
      }
    }
    verdict.status = done == 0                                                    ? ExitStatus::no_result
                     : done < eyes.size() || traced.status == ExitStatus::partial ? ExitStatus::partial
                                                                                  : ExitStatus::done;
    return verdict;
  };
  const StageOutcome outcome = run_stage(case_folder, spec, common, work);
  for (const Laterality eye : eyes) {
    const fs::path file = case_folder / "correction" / to_string(eye) / "prescription.json";
    if (fs::exists(file)) answers[to_string(eye)] = read_json(file);
  }
  Answer answer;
  answer.status = outcome.verdict.status;
  answer.json = {{"eyes", answers}, {"reasons", outcome.verdict.reasons}, {"skipped", outcome.skipped}};
  answer.text = text;
  for (const std::string& reason : outcome.verdict.reasons) answer.text += reason + "\n";
  answer.text += describe("correction", outcome, common.verbosity) + research_notice + "\n";
  return answer;
}

Answer correct_eye(const EyeModel& eye, const fs::path& output, const CorrectionSettings& settings,
                   const CommonOptions& common) {
  if (!parse_known_data(settings.known).empty())
    throw usage_error("measurements from elsewhere are learnt about a measured eye; --eye is known exactly",
                      "leave them out, or name a CASE");
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
