#include "correction/stage.hpp"

#include <fmt/core.h>

#include <charconv>
#include <cmath>
#include <string_view>

#include "correction/notation.hpp"
#include "correction/sweep.hpp"
#include "correction/what_if.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/version.hpp"
#include "raytrace/spectacle/spectacle.hpp"

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
          {"lens_index_sigma", settings.lens_index_sigma},
          {"known_refractions", settings.known_refractions},
          {"age_years", settings.age_years ? Json(*settings.age_years) : Json(nullptr)},
          {"seed", common.seed},
          {"laterality", common.laterality == LateralityChoice::both ? "both"
                         : common.laterality == LateralityChoice::od ? "od"
                                                                     : "os"},
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
    if (!parameters.at("lens_index").is_null()) settings.lens_index_sigma = 0;
    if (!settings.age_years && parameters.at("age_years").is_number())
      settings.age_years = parameters.at("age_years").get<double>();
  } catch (const nlohmann::json::exception& fault) {
    throw input_error(std::string("raytrace/stage.json: ") + fault.what(),
                      "run \"emmetrope trace --force\" on the case");
  }
}

/// "od:-2.25/-1.00x180" for this eye; nothing where none is given.
std::optional<StatedRefraction> known_refraction_of(const CorrectionSettings& settings, Laterality eye) {
  std::optional<StatedRefraction> known;
  for (const std::string& text : settings.known_refractions) {
    const auto colon = text.find(':');
    const std::string side = text.substr(0, colon);
    if (colon == std::string::npos || (side != "od" && side != "os"))
      throw usage_error("--refraction \"" + text + "\" does not say which eye",
                        "write od: or os: first, as in od:-2.25/-1.00x180@12+-0.25");
    const StatedRefraction stated = parse_refraction(text.substr(colon + 1));
    if (side == to_string(eye)) known = stated;
  }
  return known;
}

struct EyeResult {
  Prescription prescription;
  PrescriptionUncertainty uncertainty;
};

/// Another lens index, so that the sharpest lens has the mean power that is known. \returns the index
double calibrated_index(const EyeModel& eye, const PrescriptionSettings& settings, double change_of_M_D) {
  const auto M_at = [&](double index) {
    EyeModel changed = with_pupil(eye, settings.pupil_mm);
    changed.media.at("lens").index = index;
    return refraction_by_spot(changed, settings).M_D;
  };
  const double start = eye.media.at("lens").index, wanted_D = M_at(start) + change_of_M_D;
  double index = start;
  for (int i = 0; i < 8; ++i) {  // Newton; M is nearly linear in the index
    constexpr double step = 1e-3;
    const double M_D = M_at(index), slope = (M_at(index + step) - M_D) / step;
    index += (wanted_D - M_D) / slope;
    if (std::abs(wanted_D - M_D) < 1e-3) return index;
    if (!(index > 1.36 && index < 1.5)) break;
  }
  throw no_result_error(
      fmt::format(
          "no lens index between 1.36 and 1.50 explains the given refraction, {:+.2f} D from what the eye's "
          "geometry says",
          change_of_M_D),
      "check the refraction's eye and sign, and the axial length");
}

EyeResult correct_one(const raytrace::Tracer& tracer, EyeModel& eye, const CorrectionSettings& settings,
                      const std::optional<UncertainEye>& uncertain,
                      const std::optional<StatedRefraction>& known) {
  EyeResult result;
  result.prescription = prescribe(tracer, eye, settings.prescription);
  std::optional<Calibration> calibration;
  if (known) {
    const PrescriptionSettings& p = settings.prescription;
    const PowerVector at_cornea =
        move_towards_eye(to_power_vector(known->refraction), known->vertex_distance_mm);
    const PowerVector given = move_towards_eye(at_cornea, -p.vertex_distance_mm);
    const double index = calibrated_index(eye, p, given.M_D - result.prescription.refraction.M_D);
    calibration = {given, known->sigma_D.value_or(0.25), eye.media.at("lens").index, index,
                   result.prescription.refraction};
    eye.media.at("lens").index = index;
    result.prescription = prescribe(tracer, eye, p);
  }
  result.uncertainty = uncertainty_of(result.prescription, uncertain ? &*uncertain : nullptr, calibration);
  return result;
}

void write_eye_files(const fs::path& folder, const raytrace::Tracer& tracer, const EyeModel& eye,
                     const EyeResult& result, const PictureSettings& picture, std::uint64_t seed,
                     const std::string& laterality, std::optional<double> age_years) {
  const PrescriptionSettings& p = result.prescription.settings;
  fs::create_directories(folder);
  Json prescription = to_json(result.prescription, result.uncertainty, laterality);
  prescription["what_if"] = what_if_json(eye, p, result.prescription.refraction, age_years);
  write_json(folder / "prescription.json", prescription);
  write_file(folder / "sweep.csv", sweep_csv(result.prescription.plano_cylinder));
  write_file(folder / "sweep.svg", sweep_svg(result.prescription.plano_cylinder));
  raytrace::TraceSettings trace;
  trace.grid = {picture.width, picture.height, picture.field_x_mm, picture.field_y_mm, picture.centre_mm};
  trace.samples = picture.samples;
  trace.representation =
      raytrace::Representation::analytic;  // the lens; an eye's meshes are patches in it too
  trace.seed = seed;
  trace.verbosity.quiet = true;
  const EyeModel corrected =
      with_thin_lens(with_pupil(eye, picture.pupil_mm), result.prescription.refraction, p.vertex_distance_mm);
  const auto scene = raytrace::make_scene(picture.scene);
  raytrace::write_png(folder / "corrected.png", tracer.trace(corrected, *scene, trace).image);
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

/// The lens index of a measured eye that was traced is the one to be uncertain about.
UncertainEye read_uncertain_eye(const fs::path& file, double lens_index_sigma, const EyeModel& traced) {
  UncertainEye uncertain = uncertain_eye_from_json(read_json(file), file.parent_path(), lens_index_sigma);
  const auto lens = traced.media.find("lens");
  if (lens == traced.media.end()) return uncertain;  // cortex and core: the equivalent index stays
  const double index = lens->second.index;
  const Eigen::Index i = uncertain.index_of("lens_index");
  uncertain.values[i] = index;
  uncertain.covariance.row(i).setZero();
  uncertain.covariance.col(i).setZero();
  uncertain.covariance(i, i) = lens_index_sigma * lens_index_sigma;
  uncertain.eye.media.at("lens").index = index;
  return uncertain;
}

}  // namespace

Answer correct_case(const fs::path& case_folder, CorrectionSettings settings, const CommonOptions& common) {
  const CaseLock lock(case_folder, false);
  const StageVerdict traced = read_verdict(case_folder, "raytrace");
  follow_trace_stage(case_folder, settings);
  if (!settings.age_years && fs::exists(case_folder / "case.json")) {
    const Json subject = read_json(case_folder / "case.json").value("subject", Json::object());
    if (subject.contains("age_years") && subject["age_years"].is_number())
      settings.age_years = subject["age_years"].get<double>();
  }
  for (const Laterality eye : both_eyes) known_refraction_of(settings, eye);  // usage errors come first
  std::vector<Laterality> eyes;
  StageSpec spec{"correction", parameters_of(settings, common), {}, true, {}};
  for (const Laterality eye : both_eyes) {
    const std::string name = to_string(eye);
    if (!includes(common.laterality, eye) || !fs::exists(case_folder / "raytrace" / name / "eye.json"))
      continue;
    eyes.push_back(eye);
    for (const char* stage : {"meshing/", "raytrace/"})
      for (const StageInput& input : inputs_below(case_folder, stage + name)) spec.inputs.push_back(input);
  }
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
    std::size_t done = 0;
    for (const Laterality side : eyes) {
      const std::string name = to_string(side);
      try {
        EyeModel eye = read_eye(case_folder / "raytrace" / name / "eye.json");
        const fs::path optics = case_folder / "meshing" / name / "optics.json";
        std::optional<UncertainEye> uncertain;
        if (fs::exists(optics)) uncertain = read_uncertain_eye(optics, settings.lens_index_sigma, eye);
        const EyeResult result =
            correct_one(*tracer, eye, settings, uncertain, known_refraction_of(settings, side));
        write_eye_files(workspace.folder() / name, *tracer, eye, result, settings.picture, common.seed, name,
                        settings.age_years);
        const SearchResult& plano = result.prescription.plano_cylinder.search;
        if (!plano.accepted)
          workspace.warn(std::string(clinical_name(side)) + ", plano-cylinder: " + plano.reason);
        if (result.prescription.search.optima.size() > 1)
          workspace.warn(std::string(clinical_name(side)) +
                         ": more than one lens makes a locally sharpest image; see "
                         "search.distinct_optima_D in prescription.json");
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
  answer.text += "correction: " + describe(outcome) + "\n" + research_notice + "\n";
  return answer;
}

Answer correct_eye(const EyeModel& eye, const fs::path& output, const CorrectionSettings& settings,
                   const CommonOptions& common) {
  if (!settings.known_refractions.empty())
    throw usage_error("--refraction calibrates a measured eye; --eye has nothing to calibrate");
  const raytrace::Tracer tracer(common.device, common.threads);
  EyeModel seeing = eye;
  const EyeResult result = correct_one(tracer, seeing, settings, std::nullopt, std::nullopt);
  write_eye_files(output, tracer, seeing, result, settings.picture, common.seed, "", settings.age_years);
  Answer answer;
  answer.json = to_json(result.prescription, result.uncertainty, "");
  answer.text = summary(eye.name, result) + std::string(research_notice) + "\n";
  return answer;
}

}  // namespace emmetrope::correction
