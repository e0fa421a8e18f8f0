#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/notation.hpp"
#include "pipeline/base/power_vector.hpp"
#include "pipeline/base/version.hpp"
#include "pipeline/report/case/series.hpp"
#include "pipeline/report/content/content.hpp"
#include "pipeline/report/content/content_tables.hpp"
#include "pipeline/report/content/first_page.hpp"
#include "pipeline/report/content/judgement.hpp"
#include "pipeline/report/content/said.hpp"
#include "pipeline/report/document/numbers.hpp"
#include "raytrace/scene/chart.hpp"

namespace emmetrope::report {
namespace {

std::string status_text(ExitStatus status) {
  switch (status) {
    case ExitStatus::done:
      return "done";
    case ExitStatus::partial:
      return "partial result";
    case ExitStatus::no_result:
      return "the data do not support a result";
    default:
      return fmt::format("status {}", static_cast<int>(status));
  }
}

/// What was measured, with what: the first sentence of a methods section.
std::string images_sentence(const CaseData& data) {
  std::map<std::string, int> counts;
  const auto used = used_series(data);
  for (const auto& series : used) ++counts[series.in_words()];
  std::vector<std::string> stacks;
  for (const auto& [words, count] : counts)
    stacks.push_back(count > 1 ? fmt::format("{} times {}", count, words) : words);
  if (stacks.empty()) return "The images were examined with Emmetrope " + version() + ". ";
  return fmt::format("The eyes were measured with Emmetrope {} in {} MR series ({}). ", version(),
                     used.size(), fmt::join(stacks, "; "));
}

/// What the lens index leaves unknown, with the case's own numbers.
std::string limit_of_index(const CaseData& data) {
  std::vector<std::string> by_age, given;
  for (const auto& eye : data.eyes) {
    if (!judge(data, eye).has_refraction) continue;
    if (const auto index = given_lens_index(eye)) {
      given.push_back(fmt::format("{} in {}", fixed(index->value, 3), short_name(eye)));
      continue;
    }
    for (const auto& line : eye.prescription.value("budget", Json::array()))
      if (const double M_D = value_of(line, "M_D").value_or(0);
          M_D > 0 && line.value("source", std::string()).rfind("lens index", 0) == 0)
        by_age.push_back(fmt::format("{} D in {}", fixed(M_D, 2), short_name(eye)));
  }
  std::string text = "The lens's refractive index is not visible in MRI. ";
  if (!by_age.empty())
    text += fmt::format(
        "It is taken from the age; its spread of 0.005 (more below 18 and above 70 years) alone moves the spherical "
        "equivalent by {} (one standard deviation) and is part of the interval. ",
        fmt::join(by_age, " and "));
  if (!given.empty())
    text += fmt::format("By the refraction that was given it is {}. ", fmt::join(given, " and "));
  return text + "Astigmatism hardly depends on it.";
}

/// The conditions of the refraction.
std::string refraction_sentence(const CaseData& data) {
  for (const auto& eye : data.eyes) {
    const auto pupil = value_of(eye.prescription, "pupil_mm"),
               wavelength = value_of(eye.prescription, "wavelength_nm"),
               vertex = value_of(eye.prescription, "vertex_distance_mm");
    if (!pupil || !vertex) continue;
    return fmt::format("Refraction is for distance {}, an iris aperture of {} mm{}. ",
                       *vertex == 0 ? "at the cornea, of a contact lens"
                                    : fmt::format("at {:g} mm vertex distance", *vertex),
                       fixed(*pupil, 1),
                       wavelength ? " and " + fixed(*wavelength, 1) + " nm" : std::string()) +
           "Wavefront, modulation transfer, letters and pictures are those of " + traced_pupil(data) + ". ";
  }
  return {};
}

}  // namespace

std::string refracted_point(const CaseData& data) {
  const auto said_of = [](const Json& holder) -> std::string {
    const auto x_mm = value_at(holder, "/fovea_mm/0"), y_mm = value_at(holder, "/fovea_mm/1");
    return x_mm && y_mm && (*x_mm != 0 || *y_mm != 0)
               ? fmt::format("at ({:g}, {:g}) mm from the pole of the retina, as was asked for", *x_mm, *y_mm)
               : std::string();
  };
  for (const auto& eye : data.eyes)
    if (std::string point = said_of(eye.prescription); !point.empty()) return point;
  // Older prescriptions do not say it themselves.
  if (const StageData* traced = data.stage("raytrace"))
    if (std::string point = said_of(traced->provenance.value("parameters", Json::object())); !point.empty())
      return point;
  return "on the eye's own axis";
}

std::string traced_pupil(const CaseData& data) {
  const StageData* traced = data.stage("raytrace");
  const auto pupil_mm =
      traced == nullptr ? std::nullopt : value_at(traced->provenance, "/parameters/pupil_mm");
  return pupil_mm ? fmt::format("an iris aperture of {} mm", fixed(*pupil_mm, 1))
                  : "the pupil that was traced";
}

std::string worn_while_traced(const CaseData& data) {
  const StageData* traced = data.stage("raytrace");
  if (traced == nullptr) return {};
  const Json parameters = traced->provenance.value("parameters", Json::object());
  const auto is_given = [&](const char* key) {
    return parameters.is_object() && parameters.contains(key) && !parameters[key].is_null();
  };
  if (is_given("plano_cylinder")) return "a plano-cylinder";
  if (!is_given("spectacle")) return {};
  const auto of_spectacle = [&](const std::string& key) { return value_at(parameters, "/spectacle/" + key); };
  std::string worn = "a spectacle";
  const auto M_D = of_spectacle("power/M_D"), J0_D = of_spectacle("power/J0_D"),
             J45_D = of_spectacle("power/J45_D");
  if (M_D && J0_D && J45_D) worn += " of " + format_refraction(to_sphero_cylinder({*M_D, *J0_D, *J45_D}));
  if (const auto distance_mm = of_spectacle("vertex_distance_mm"))
    worn += fmt::format(" at {:g} mm", *distance_mm);
  const auto prism = of_spectacle("prism/dioptres"), base_deg = of_spectacle("prism/base_deg");
  if (prism && base_deg && *prism > 0)
    worn += fmt::format(" with {:g} prism dioptres, base at {:g} degrees", *prism, *base_deg);
  return worn;
}

std::string chart_rows(const CaseData& data) {
  const StageData* traced = data.stage("raytrace");
  if (traced == nullptr) return {};
  const Json parameters = traced->provenance.value("parameters", Json::object());
  if (!parameters.is_object() || !parameters.contains("scene") || !parameters["scene"].is_string()) return {};
  std::vector<double> logmar;
  try {
    logmar = raytrace::logmar_of_rows(raytrace::parse_chart(parameters["scene"].get<std::string>()));
  } catch (const Error&) {
    return {};  // a scene of its own
  }
  if (logmar.empty()) return {};
  std::string text = logmar.size() == 1
                         ? fmt::format(" The letters are of logMAR {}", fixed(logmar.front(), 1))
                         : fmt::format(" Rows go from logMAR {} at the top down to {}, 0.1 a row",
                                       fixed(logmar.front(), 1), fixed(logmar.back(), 1));
  // A pixel ends what the picture shows, whatever the eye; 17 mm from the nodal point an angle is known well enough.
  const auto field_mm = value_at(parameters, "/field_mm/0"), pixels = value_at(parameters, "/size/0");
  if (field_mm && pixels && *field_mm > 0 && *pixels > 0)
    text += fmt::format("; strokes below logMAR {} are finer than a pixel",
                        fixed(std::log10(*field_mm / *pixels / 17 / degree * 60), 1));
  return text + ".";
}

Section review_section() {
  return {"review", "Review", {{SignatureLines{{"Comment", "Reviewed by, date, signature"}}}}};
}

Section limits_section(const CaseData& data, const Notes& notes) {
  Section section{"limits", "Limits and warnings", {}};
  BulletList general;
  general.items = {std::string(research_notice)};
  for (const char* limit :
       {"MRI shows the eye at a fraction of a millimetre. One tenth of a millimetre of corneal "
        "radius is about 0.6 D, one tenth of a millimetre of axial length about 0.26 D: read "
        "every number with its interval.",
        "The back of the cornea is taken as a fixed proportion of its front where the images do "
        "not resolve it.",
        "Images of the orbit may let a face be recognised even where no name is given."})
    general.items.emplace_back(limit);
  general.items.insert(general.items.begin() + 2, limit_of_index(data));
  general.items.push_back("The retina's fovea is not visible: the refraction is given " +
                          refracted_point(data) + ", which may lie a few degrees from the line of sight.");
  section.blocks.push_back({general});
  BulletList found;
  const auto add_once = [&](const std::string& item) {
    if (std::find(found.items.begin(), found.items.end(), item) == found.items.end())
      found.items.push_back(item);
  };
  std::vector<std::string> said;
  for (const auto& stage : data.stages) {
    for (const auto& warning : stage.warnings) {
      add_once(stage.name + ": " + warning);
      said.push_back(warning);
    }
    if (stage.status == ExitStatus::done) continue;
    for (const auto& reason : stage.reasons) {
      if (is_said(reason, said)) continue;
      found.items.push_back(stage.name + ": " + reason);
      said.push_back(reason);
    }
  }
  for (const auto& note : notes) found.items.push_back("report: " + note);
  if (!found.items.empty()) {
    section.blocks.push_back({Paragraph{"In this case:"}});
    section.blocks.push_back({found});
  } else {
    section.blocks.push_back(
        {Paragraph{"In this case no stage before the report had an error or a warning."}});
  }
  return section;
}

Section methods_section(const CaseData& data, Citations& citations) {
  Section section{"methods", "Methods", {}};
  const std::string refraction = refraction_sentence(data);
  const bool is_traced = std::any_of(data.eyes.begin(), data.eyes.end(),
                                     [](const EyeData& eye) { return eye.wavefront.is_object(); });
  std::string text =
      images_sentence(data) + refraction +
      "The eyes are found in the MR volumes by radial symmetry and paired by the patient's coordinates. A "
      "parametric eye (biconic cornea, two-conic lens, ellipsoid globe with a smooth displacement) is fitted to the "
      "voxels through a model of the acquisition; the covariance of the fit gives the intervals. The surfaces are "
      "meshed";
  if (is_traced)
    text += fmt::format(
        " and light is traced backward from the retina through them [{}]. Wavefronts follow [{}], the lens index "
        "[{}]",
        citations.number_of("Wei et al. 2014"), citations.number_of("ANSI Z80.28"),
        citations.number_of("Dubbelman and van der Heijde 2001, index"));
  if (!refraction.empty())
    text += fmt::format(
        ". The lens is the one that makes the retinal image sharpest; refractions are averaged and compared as power "
        "vectors [{}]",
        citations.number_of("Thibos et al. 1997"));
  section.blocks.push_back({Paragraph{text + ". This text may be copied into a paper."}});
  section.blocks.push_back(
      {Paragraph{
           "Frames: light is described in the eye's frame, x to the examiner's right, y up, z out of "
           "the eye; origin at the corneal apex. Wavefront maps and axes are as the examiner sees them."},
       Paper::never});
  section.blocks.push_back({BulletList{citations.list(), true}});
  return section;
}

Section provenance_section(const CaseData& data) {
  Section section{"provenance", "Provenance", {}};
  Table table{"Stages", {"Stage", "Version", "Seed", "Device", "Result"}, {}};
  for (const auto& stage : data.stages) {
    const auto text = [&](const char* key) {
      const Json found = stage.provenance.value(key, Json());
      return found.is_string() ? found.get<std::string>()
             : found.is_null() ? std::string("\u2013")
                               : found.dump();
    };
    table.rows.push_back(
        {stage.name, text("version"), text("seed"), text("opencl_device"), status_text(stage.status)});
  }
  section.blocks.push_back({table, Paper::never});
  std::string line = "Made by Emmetrope " + version() + ".";
  for (const auto& stage : data.stages)
    line += " " + stage.name + ": " + status_text(stage.status) +
            (stage.provenance.contains("inputs_sha256")
                 ? ", inputs " + stage.provenance["inputs_sha256"].get<std::string>().substr(0, 12)
                 : std::string()) +
            ".";
  section.blocks.push_back(
      {Paragraph{line + " Full provenance is in the HTML report and in each stage.json."}});
  const auto dump = [](const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace); };
  for (const auto& stage : data.stages)
    section.blocks.push_back(
        {Folded{stage.name + ": parameters and SHA-256 of inputs and outputs", dump(stage.provenance)},
         Paper::never});
  section.blocks.push_back({Folded{"case.json", dump(data.case_json)}, Paper::never});
  return section;
}

}  // namespace emmetrope::report
