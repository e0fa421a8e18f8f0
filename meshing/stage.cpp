#include "meshing/stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "meshing/biometry.hpp"
#include "meshing/gifti.hpp"
#include "meshing/mesh_check.hpp"
#include "meshing/optics.hpp"
#include "meshing/remesh.hpp"
#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/eye/instruments/topography.hpp"

namespace emmetrope::meshing {
namespace {

namespace fs = std::filesystem;

constexpr double head_roll_limit_deg = 3;
/// Vertices of each surface, by name.
std::map<std::string, int> parse_vertices(const std::vector<std::string>& texts) {
  std::map<std::string, int> counts;
  for (const std::string& text : texts) {
    const auto colon = text.find(':');
    const std::string name = colon == std::string::npos ? "" : text.substr(0, colon);
    const std::string digits = colon == std::string::npos ? text : text.substr(colon + 1);
    const bool known = name.empty() || name == "cornea_anterior" || name == "cornea_posterior" ||
                       name == "lens_anterior" || name == "lens_posterior" || name == "retina";
    if (!known || digits.empty() || digits.size() > 7 ||
        digits.find_first_not_of("0123456789") != std::string::npos)
      throw usage_error("--vertices " + text + ": cannot be read",
                        "expected N or SURFACE:N, such as retina:973");
    counts[name] = std::stoi(digits);
  }
  return counts;
}

struct FittedEye {
  Json fit;
  EyeEstimate estimate;
  std::optional<Topography> topography;
};

/// The eye's fit; nothing where segmentation has none or refused it, with the reason.
std::optional<FittedEye> read_fit(const fs::path& case_folder, Laterality eye,
                                  std::vector<std::string>& reasons) {
  const fs::path file = case_folder / "segmentation" / to_string(eye) / "fit.json";
  if (!fs::exists(file)) {
    reasons.push_back(fmt::format("{}: segmentation found no such eye", clinical_name(eye)));
    return std::nullopt;
  }
  try {
    const Json fit = read_json(file);
    if (fit.at("status") == "refused") {
      std::string why;
      for (const Json& gate : fit.at("quality")) {
        if (!gate.at("passed").get<bool>())
          why += (why.empty() ? "" : "; ") + gate.at("reason").get<std::string>();
      }
      reasons.push_back(fmt::format("{}: refused by segmentation: {}", clinical_name(eye), why));
      return std::nullopt;
    }
    return FittedEye{fit, EyeEstimate(parametric_eye_from_json(fit.at("eye"))), std::nullopt};
  } catch (const nlohmann::json::exception& fault) {
    throw input_error(file.string() + " is broken: " + fault.what(), "make it again with: emmetrope segment");
  } catch (Error& error) {
    error.add_context("reading " + file.string());
    throw;
  }
}

OpticalDefaults optical_defaults(const fs::path& case_folder, double retinal_depth_mm) {
  OpticalDefaults defaults;
  defaults.retinal_depth_mm = retinal_depth_mm;
  const fs::path file = case_folder / "case.json";
  if (!fs::exists(file)) return defaults;
  const Json subject = read_json(file).value("subject", Json::object());
  const auto age = subject.find("age_years");
  if (age != subject.end() && age->is_number()) defaults.lens_index = lens_index_at_age(age->get<double>());
  return defaults;
}

TriangleMesh in_lps(TriangleMesh mesh, const Eigen::Isometry3d& lps_from_eye) {
  for (auto& vertex : mesh.vertices) vertex = lps_from_eye * vertex;
  for (auto& normal : mesh.normals) normal = lps_from_eye.linear() * normal;
  return mesh;
}

/// Where the eyes were measured in different series the head has moved between them, by 1 to 3 mm as a rule;
/// within one series it has not.
double head_motion_sd_mm(const Json& od_fit, const Json& os_fit) {
  constexpr double between_series_sd_mm = 1.0;
  const auto stacks = [](const Json& fit) { return fit.value("stacks", Json::array()); };
  const Json od = stacks(od_fit), os = stacks(os_fit);
  const bool same = !od.empty() && !os.empty() && od.at(0).at("name") == os.at(0).at("name");
  return same ? 0 : between_series_sd_mm;
}

/// Writes the sheets of one eye. \return their measured quality, by name
Json write_meshes(const fs::path& folder, const FittedEye& fitted, const MeshingOptions& options) {
  const ParametricEye& eye = fitted.estimate.eye();
  const std::map<std::string, int> counts = parse_vertices(options.vertices);
  const ShapePtr cornea = fitted.topography ? anterior_cornea_shape(eye, *fitted.topography) : nullptr;
  const double reach_mm = fitted.topography ? fitted.topography->zone_mm / 2 : 0;
  Json report = Json::object();
  for (const NamedSheet& sheet : make_sheets(eye, cornea, reach_mm)) {
    int vertices = sheet.paper_vertices;
    for (const std::string& key : {std::string(), sheet.name}) {
      if (const auto wanted = counts.find(key); wanted != counts.end()) vertices = wanted->second;
    }
    const TriangleMesh mesh = options.edge_mm > 0 ? mesh_with_edge(*sheet.sheet, options.edge_mm)
                                                  : mesh_with_vertices(*sheet.sheet, vertices);
    report[sheet.name] = to_json(check_sheet(mesh));
    const TriangleMesh lps = in_lps(mesh, eye.lps_from_eye);
    write_mesh(folder / (sheet.name + ".ply"), lps, true);
    for (const std::string& format : options.formats) {
      if (format == "gii")
        write_gifti(folder / (sheet.name + ".surf.gii"), lps);
      else if (format != "ply")
        write_mesh(folder / (sheet.name + "." + format), lps, true);
    }
  }
  return report;
}

std::string summary(const Json& biometry) {
  const auto line = [](const char* what, const Json& json, const char* unit) {
    const auto m = json.get<Measured>();
    return fmt::format("  {:<26}{:8.2f} {:<3} (95 % {:.2f} to {:.2f}, {})\n", what, m.value, unit, m.ci95[0],
                       m.ci95[1], m.source);
  };
  const Json& k = biometry.at("keratometry");
  return line("axial length", biometry.at("axial_length_mm"), "mm") +
         line("anterior chamber depth", biometry.at("anterior_chamber_depth_mm"), "mm") +
         line("lens thickness", biometry.at("lens_thickness_mm"), "mm") +
         line("flat K", k.at("flat").at("power_D"), "D") +
         line("  at axis", k.at("flat").at("axis_deg"), "deg") +
         line("steep K", k.at("steep").at("power_D"), "D") +
         line("corneal cylinder", k.at("cylinder_D"), "D");
}

}  // namespace

Answer make_meshes(const MeshingOptions& options, const CommonOptions& common) {
  const auto instruments = parse_instruments(options.instruments, options.retinal_depth_mm);
  parse_vertices(options.vertices);
  const StageVerdict segmentation = read_verdict(options.case_folder, "segmentation");

  StageSpec spec;
  spec.stage = "meshing";
  spec.parameters = {{"laterality", to_string(common.laterality)},
                     {"keratometry", options.instruments.keratometry},
                     {"axial_length", options.instruments.axial_length},
                     {"acd", options.instruments.anterior_chamber_depth},
                     {"lens_thickness", options.instruments.lens_thickness},
                     {"topography", options.instruments.topography},
                     {"vertices", options.vertices},
                     {"edge_mm", options.edge_mm},
                     {"formats", options.formats},
                     {"retinal_depth_mm", options.retinal_depth_mm},
                     {"scale_sd", options.scale_sd}};
  for (const Laterality eye : both_eyes) {
    const std::string name = std::string("segmentation/") + to_string(eye) + "/fit.json";
    if (fs::exists(options.case_folder / name)) spec.inputs.push_back({name, options.case_folder / name});
  }
  for (const auto& [eye, measured] : instruments) {
    if (measured.topography)
      spec.inputs.push_back({std::string("topography/") + to_string(eye), measured.topography->file});
  }
  if (fs::exists(options.case_folder / "case.json"))
    spec.inputs.push_back({"case.json", options.case_folder / "case.json"});

  const StageOutcome outcome = run_stage(options.case_folder, spec, common, [&](StageWorkspace& workspace) {
    StageVerdict verdict;
    verdict.reasons = segmentation.reasons;
    std::map<Laterality, FittedEye> eyes;
    for (const Laterality eye : both_eyes) {
      std::vector<std::string> reasons;
      if (auto fitted = read_fit(options.case_folder, eye, reasons)) eyes.emplace(eye, std::move(*fitted));
      if (includes(common.laterality, eye))
        verdict.reasons.insert(verdict.reasons.end(), reasons.begin(), reasons.end());
    }
    for (const auto& [eye, measured] : instruments)
      if (eyes.count(eye) == 0)
        workspace.warn(
            fmt::format("{}: not measured in the images, so that what other instruments say of it is "
                        "not used",
                        clinical_name(eye)));
    for (auto& [eye, fitted] : eyes) {
      fitted.estimate.add_scale_prior(options.scale_sd);
      const auto measured = instruments.find(eye);
      if (measured == instruments.end()) continue;
      InstrumentReadings readings = read_instruments(measured->second);
      fitted.topography = std::move(readings.topography);
      for (const ExternalMeasurement& measurement : readings.measurements) {
        const double surprise = fitted.estimate.assimilate(measurement);
        const std::string text = fmt::format("{}: {} and the images differ by {:.1f} standard deviations",
                                             clinical_name(eye), measurement.source, surprise);
        if (surprise > irreconcilable_sigma)
          throw input_error(
              text + ": they cannot both be of this eye",
              "check eye, unit and digits of the measurement; without it the images speak alone");
        if (surprise > surprising_sigma) workspace.warn(text);
      }
    }

    std::optional<Measured> interpupillary;
    if (eyes.size() == 2)
      interpupillary = interpupillary_distance_mm(
          eyes.at(Laterality::od).estimate, eyes.at(Laterality::os).estimate, options.scale_sd,
          head_motion_sd_mm(eyes.at(Laterality::od).fit, eyes.at(Laterality::os).fit));
    const OpticalDefaults defaults = optical_defaults(options.case_folder, options.retinal_depth_mm);
    int meshed = 0, wanted = 0;
    Json quality = Json::object();
    for (const Laterality eye : both_eyes) {
      if (!includes(common.laterality, eye)) continue;
      ++wanted;
      const auto found = eyes.find(eye);
      if (found == eyes.end()) continue;
      const EyeEstimate& estimate = found->second.estimate;
      const fs::path folder = workspace.folder() / to_string(eye);
      fs::create_directories(folder);
      quality[to_string(eye)] = write_meshes(folder, found->second, options);

      Json biometry = biometry_json(estimate, {options.retinal_depth_mm},
                                    found->second.topography ? &*found->second.topography : nullptr);
      const Json& roll = found->second.fit.at("head_roll_deg");
      biometry["head_roll_deg"] = roll;
      if (interpupillary) biometry["interpupillary_distance_mm"] = *interpupillary;
      const std::vector<PlausibilityFlag> flags = plausibility(biometry);
      biometry["plausibility"] = to_json(flags);
      for (const PlausibilityFlag& flag : flags) {
        if (!flag.passed) workspace.warn(std::string(clinical_name(eye)) + ": " + flag.describe());
      }
      if (meshed == 0 && roll.is_number() && std::abs(roll.get<double>()) > head_roll_limit_deg)
        workspace.warn(fmt::format(
            "the head is rolled by {:.1f} degrees against the scanner, in which astigmatic axes are given",
            roll.get<double>()));
      write_json(folder / "biometry.json", biometry);
      write_json(folder / "optics.json", optics_json(estimate, defaults));
      ++meshed;
    }
    workspace.provenance()["meshes"] = quality;
    verdict.status = meshed == wanted ? ExitStatus::done
                     : meshed > 0     ? ExitStatus::partial
                                      : ExitStatus::no_result;
    return verdict;
  });

  Answer answer;
  answer.status = outcome.verdict.status;
  answer.json = {{"status", static_cast<int>(outcome.verdict.status)},
                 {"reasons", outcome.verdict.reasons},
                 {"skipped", outcome.skipped},
                 {"meshes", outcome.stage_json.value("meshes", Json::object())},
                 {"eyes", Json::object()}};
  answer.text = describe("meshing", outcome, common.verbosity);
  for (const std::string& reason : outcome.verdict.reasons) answer.text += reason + "\n";
  for (const Laterality eye : both_eyes) {
    const fs::path file = options.case_folder / "meshing" / to_string(eye) / "biometry.json";
    if (!includes(common.laterality, eye) || !fs::exists(file)) continue;
    const Json biometry = read_json(file);
    answer.json["eyes"][to_string(eye)] = biometry;
    answer.text += std::string(clinical_name(eye)) + "\n" + summary(biometry);
  }
  return answer;
}

}  // namespace emmetrope::meshing
