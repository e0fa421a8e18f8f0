#include "pipeline/report/living/case_eyes.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>

#include "pipeline/base/case_subject.hpp"
#include "pipeline/eye/measured/uncertain_optics.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/content/learnt.hpp"
#include "pipeline/report/living/living_data.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

std::optional<SpheroCylinder> power_in(const Json& json) {
  const auto sphere = value_of(json, "sphere_D"), cylinder = value_of(json, "cylinder_D"),
             axis = value_of(json, "axis_deg");
  if (!sphere) return std::nullopt;
  return SpheroCylinder{*sphere, cylinder.value_or(0), axis.value_or(0)};
}

/// The eye's own only where its prescription is given and is of the eye that looks out of the page, the traced one.
std::vector<NamedLens> lenses_of(const EyeData& eye, bool has_prescription) {
  std::vector<NamedLens> lenses;
  const Json& prescription = eye.prescription;
  const bool has_own = has_prescription && learnt_since_traced(eye) != Learnt::readings;
  const double vertex_mm = value_of(prescription, "vertex_distance_mm").value_or(12);
  const auto add = [&](const char* name, const Json& json) {
    if (!json.is_object()) return;
    if (const auto power = power_in(json)) lenses.push_back({name, *power, vertex_mm});
  };
  // A given refraction has moved what is known of the eye; the one that looks out of the page is that of the images, and
  // what was rounded is not its lens.
  const Json calibration = prescription.value("calibration", Json());
  if (calibration.is_object()) {
    if (has_own) add("best", calibration.value("without_it", Json()));
    add("known", calibration.value("given", Json()));
  } else if (has_own) {
    add("best", prescription);
    add("rounded", prescription.value("rounded", Json()));
  }
  return lenses;
}

std::optional<double> parameter_of(const CaseData& data, const char* stage, const char* pointer) {
  const StageData* found = data.stage(stage);
  return found == nullptr ? std::nullopt : value_at(found->provenance, pointer);
}

/// As the eye was traced: of the study, else what trace was told.
double age_years_of(const CaseData& data) {
  const auto told = parameter_of(data, "raytrace", "/parameters/age_years");
  return subject_age_years(data.folder).value_or(told.value_or(usual_age_years));
}

/// As the correction stage has it; before that of the age, or known where trace was told the index.
double lens_index_sigma_of(const CaseData& data) {
  if (const auto corrected = parameter_of(data, "correction", "/parameters/lens_index_sigma"))
    return *corrected;
  return parameter_of(data, "raytrace", "/parameters/lens_index")
             ? 0
             : lens_index_at_age(age_years_of(data)).sigma;
}

/// As the prescription beside the picture is.
raytrace::BandRefraction band_refraction_of(const Json& prescription) {
  raytrace::BandRefraction refraction;
  refraction.pupil_mm = value_of(prescription, "pupil_mm").value_or(refraction.pupil_mm);
  refraction.vertex_distance_mm =
      value_of(prescription, "vertex_distance_mm").value_or(refraction.vertex_distance_mm);
  refraction.wavelength_nm = value_of(prescription, "wavelength_nm");
  return refraction;
}

LivingSubject subject_of(const CaseData& data, const EyeData& eye, const raytrace::EyeMapSettings& settings) {
  LivingSubject subject;
  subject.id = eye.id();
  subject.name = eye.laterality == Laterality::od ? "OD (right)" : "OS (left)";
  subject.eye = read_eye(data.folder / "raytrace" / eye.id() / "eye.json");
  const fs::path optics_file = data.folder / "meshing" / eye.id() / "optics.json";
  const double age_years = age_years_of(data);
  std::optional<UncertainOptics> optics;
  if (fs::exists(optics_file))
    optics = read_uncertain_optics(optics_file, lens_index_sigma_of(data), subject.eye);
  subject.living = raytrace::living_measured_eye(subject.eye, optics ? &*optics : nullptr, age_years,
                                                 settings, band_refraction_of(eye.prescription));
  subject.has_prescription = false;
  if (eye.prescription.is_object()) {
    const Judgement judgement = judge(data, eye);
    subject.has_prescription = judgement.has_prescription;
    if (judgement.has_refraction) {
      subject.withheld = withheld_because(eye);
      subject.lenses = lenses_of(eye, judgement.has_prescription);
      subject.pupil_mm = value_of(eye.prescription, "pupil_mm").value_or(subject.pupil_mm);
      const Json M = eye.prescription.value("M_D", Json());
      if (M.is_object() && M.contains("ci95")) {
        const auto measured = M.get<Measured>();
        subject.half_width_D = (measured.ci95[1] - measured.ci95[0]) / 2;
      }
    }
  }
  return subject;
}

}  // namespace

CaseEyes living_eyes_of(const CaseData& data, int threads, std::uint64_t seed) {
  raytrace::EyeMapSettings settings;
  settings.threads = threads;
  settings.seed = seed;
  CaseEyes result;
  for (const auto& eye : data.eyes) {
    const std::string name = eye.laterality == Laterality::od ? "OD" : "OS";
    if (!fs::exists(data.folder / "raytrace" / eye.id() / "eye.json")) {
      result.notes.push_back(
          name + " looks out of no picture: it was not traced (without cornea or lens there is none).");
      result.not_traced.push_back(result.notes.back());
      continue;
    }
    try {
      const LivingSubject subject = subject_of(data, eye, settings);
      result.eyes.push_back(living_json(subject, threads));
      result.notes.push_back(name + ", its map: " + subject.living.map.note() + ".");
      if (learnt_since_traced(eye) == Learnt::readings)
        result.notes.push_back(
            name + " looks as " + meshed_from(data, eye) +
            " show it: what was given to the correction has changed the result above, not this eye, "
            "for which that lens is not. Readings that are given to emmetrope mesh are in both.");
      else if (eye.prescription.is_object() && eye.prescription.contains("calibration") &&
               !is_contradicted(eye.prescription))
        result.notes.push_back(name + " looks as " + meshed_from(data, eye) +
                               " show it: the refraction that was given has changed the "
                               "result above, not this eye, which may see less through the known glasses.");
      for (const auto& note : subject.living.left_out)
        result.notes.push_back(fmt::format("{}: {}.", name, note));
    } catch (const Error& error) {
      if (error.status() == ExitStatus::fault) throw;
      result.notes.push_back(name + " looks out of no picture: " + error.what() + ".");
      spdlog::warn("{}", result.notes.back());
    }
  }
  return result;
}

}  // namespace emmetrope::report
