#include "meshing/stage.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <set>

#include "meshing/biometry.hpp"
#include "meshing/gifti.hpp"
#include "meshing/mesh_check.hpp"
#include "meshing/optics.hpp"
#include "meshing/partial_biometry.hpp"
#include "meshing/remesh.hpp"
#include "pipeline/base/case_subject.hpp"
#include "pipeline/base/eye_stage.hpp"
#include "pipeline/eye/instruments/topography.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::meshing {
namespace {

namespace fs = std::filesystem;

struct FittedEye {
  Json fit;
  UncertainEye estimate;
  std::optional<Topography> topography;
  std::string cornea_withheld;  ///< why; empty: its shape is known
  std::string front_withheld;   ///< why; empty: there is more than the back of the globe

  bool has_optics() const { return cornea_withheld.empty() && front_withheld.empty(); }
};

/// What segmentation knows of an eye: its fit, or what edges tell where that is withheld.
struct SegmentedEye {
  Json fit;
  std::optional<FittedEye> fitted;
};

/// False where `segment --laterality` named the other eye.
bool was_asked_for(const fs::path& case_folder, Laterality eye) {
  const fs::path file = case_folder / "segmentation" / "stage.json";
  if (!fs::exists(file)) return true;
  const Json stage = read_json(file);
  const Json::json_pointer at("/parameters/laterality");
  if (!stage.is_object() || !stage.contains(at) || !stage.at(at).is_string()) return true;
  const std::string asked = stage.at(at).get<std::string>();
  return asked == "both" || asked == to_string(eye);
}

/// \throw Error (no_result) where segmentation knows nothing of the eye, with the reason
SegmentedEye read_segmented(const fs::path& case_folder, Laterality eye) {
  const fs::path file = case_folder / "segmentation" / to_string(eye) / "fit.json";
  if (!fs::exists(file))
    throw no_result_error(was_asked_for(case_folder, eye) ? "segmentation found no such eye"
                                                          : "segmentation was asked for the other eye alone");
  try {
    const Json fit = read_json(file);
    const Json& withheld = fit.at("withheld");
    if (fit.at("status") == "refused")
      throw no_result_error(refused_by_segmentation + withheld.at("fit").get<std::string>());
    if (withheld.contains("fit")) return {fit, std::nullopt};
    return {fit, FittedEye{fit, fitted_eye(parametric_eye_from_json(fit.at("eye"))), std::nullopt,
                           withheld.value("cornea", std::string()), withheld.value("front", std::string())}};
  } catch (const nlohmann::json::exception& fault) {
    throw input_error(file.string() + " is broken: " + fault.what(), "make it again with: emmetrope segment");
  } catch (Error& error) {
    if (error.status() != ExitStatus::no_result) error.add_context("reading " + file.string());
    throw;
  }
}

OpticalDefaults optical_defaults(const fs::path& case_folder, double retinal_depth_mm) {
  OpticalDefaults defaults;
  defaults.retinal_depth_mm = retinal_depth_mm;
  const LensIndex index = lens_index_at_age(subject_age_years(case_folder).value_or(usual_age_years));
  defaults.lens_index = index.mean;
  defaults.lens_index_sigma = index.sigma;
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

/// Writes the sheets of one eye.
/// \return their measured quality, by name
Json write_meshes(const fs::path& folder, const FittedEye& fitted, const MeshingOptions& options) {
  const ParametricEye& eye = fitted.estimate.eye();
  const ShapePtr cornea = fitted.topography ? anterior_cornea_shape(eye, *fitted.topography) : nullptr;
  const double reach_mm = fitted.topography ? fitted.topography->zone_mm / 2 : 0;
  Json report = Json::object();
  for (const NamedSheet& sheet : make_sheets(eye, cornea, reach_mm)) {
    const bool is_cornea = sheet.name.rfind("cornea", 0) == 0;
    if (is_cornea && !fitted.cornea_withheld.empty()) continue;
    if (sheet.name != "retina" && !fitted.front_withheld.empty()) continue;
    int vertices = sheet.paper_vertices;
    for (const std::string& key : {std::string(), sheet.name}) {
      if (const auto wanted = options.vertices.find(key); wanted != options.vertices.end())
        vertices = wanted->second;
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
    if (is_withheld(json)) return fmt::format("  {:<26}withheld\n", what);
    const auto m = json.get<Measured>();
    return fmt::format("  {:<26}{:8.2f} {:<3} (95 % {:.2f} to {:.2f}, {})\n", what, m.value, unit, m.ci95[0],
                       m.ci95[1], m.method == "edges" ? m.source + ", edges" : m.source);
  };
  const Json& k = biometry.at("keratometry");
  const Json& cylinder = k.at("cylinder_D");
  const bool may_be_sphere = !is_withheld(cylinder) && cylinder.get<Measured>().ci95[0] <= 0;
  return line("axial length, optical", biometry.at("optical_axial_length_mm"), "mm") +
         line("  to the inner retina", biometry.at("axial_length_mm"), "mm") +
         line("anterior chamber depth", biometry.at("anterior_chamber_depth_mm"), "mm") +
         line("lens thickness", biometry.at("lens_thickness_mm"), "mm") +
         line("flat K", k.at("flat").at("power_D"), "D") +
         (may_be_sphere ? std::string("    at axis                 not determined\n")
                        : line("  at axis", k.at("flat").at("axis_deg"), "deg")) +
         line("steep K", k.at("steep").at("power_D"), "D") +
         line("corneal cylinder", k.at("cylinder_D"), "D");
}

Json parameters_of(const MeshingOptions& options, const CommonOptions& common) {
  return {{"laterality", to_string(common.laterality)},
          {"instruments", to_json(options.instruments)},
          {"vertices", options.vertices},
          {"edge_mm", options.edge_mm},
          {"formats", options.formats},
          {"retinal_depth_mm", options.retinal_depth_mm},
          {"scale_sd", options.scale_sd}};
}

std::vector<StageInput> inputs_of(const MeshingOptions& options) {
  std::vector<StageInput> inputs;
  for (const Laterality eye : both_eyes) {
    const std::string name = std::string("segmentation/") + to_string(eye) + "/fit.json";
    if (fs::exists(options.case_folder / name)) inputs.push_back({name, options.case_folder / name});
  }
  for (const auto& [eye, measured] : options.instruments)
    if (measured.topography)
      inputs.push_back({std::string("topography/") + to_string(eye), measured.topography->file});
  if (fs::exists(options.case_folder / "case.json"))
    inputs.push_back({"case.json", options.case_folder / "case.json"});
  return inputs;
}

/// What is known of the eyes that segmentation measured, with what other instruments say of them.
struct KnownEyes {
  std::map<Laterality, FittedEye> fitted;
  std::map<Laterality, Json> read;            ///< fit.json of eyes known by their edges alone
  std::map<Laterality, std::string> missing;  ///< why, of the others
};

KnownEyes read_eyes(const MeshingOptions& options, StageWorkspace& workspace) {
  KnownEyes eyes;
  for (const Laterality eye : both_eyes) {
    try {
      SegmentedEye segmented = read_segmented(options.case_folder, eye);
      if (segmented.fitted)
        eyes.fitted.emplace(eye, std::move(*segmented.fitted));
      else
        eyes.read.emplace(eye, std::move(segmented.fit));
    } catch (const Error& error) {
      if (error.status() != ExitStatus::no_result) throw;
      eyes.missing[eye] = error.what();
    }
  }
  for (const auto& [eye, measured] : options.instruments) {
    if (eyes.fitted.count(eye) == 0)
      workspace.warn(std::string(clinical_name(eye)) +
                     ": not fitted to the images, so that what other instruments say of it is not used");
  }
  return eyes;
}

void learn_from_instruments(KnownEyes& eyes, const MeshingOptions& options, StageWorkspace& workspace) {
  for (auto& [eye, fitted] : eyes.fitted) {
    fitted.estimate.add_scale_prior(options.scale_sd);
    const auto measured = options.instruments.find(eye);
    if (measured == options.instruments.end()) continue;
    if (!fitted.front_withheld.empty()) {
      workspace.warn(
          std::string(clinical_name(eye)) +
          ": its front is not in the images, so that what other instruments say of it is not used");
      continue;
    }
    InstrumentReadings readings = read_instruments(measured->second);
    fitted.topography = std::move(readings.topography);
    try {
      for (const std::string& warning : learn(fitted.estimate, readings))
        workspace.warn(std::string(clinical_name(eye)) + ": " + warning);
    } catch (const Error& error) {
      throw said_of(eye, error);
    }
    const double sigma_over_prior =
        fitted.estimate.sigma("cornea_c_per_mm") / population_value("cornea_c_per_mm").sigma;
    if (limits_of("cornea_sigma_over_prior").accepted.contains(sigma_over_prior))
      fitted.cornea_withheld.clear();
  }
}

std::optional<Measured> interpupillary_distance(const KnownEyes& eyes, double scale_sd) {
  if (eyes.fitted.size() != 2) return std::nullopt;
  const FittedEye &od = eyes.fitted.at(Laterality::od), &os = eyes.fitted.at(Laterality::os);
  return interpupillary_distance_mm(od.estimate, os.estimate, scale_sd, head_motion_sd_mm(od.fit, os.fit));
}

/// What is implausible in a biometry.json goes into it and is told.
void flag(Json& biometry, Laterality eye, StageWorkspace& workspace) {
  const std::vector<PlausibilityFlag> flags = plausibility(biometry);
  biometry["plausibility"] = to_json(flags);
  for (const PlausibilityFlag& flag : flags)
    if (!flag.passed()) workspace.warn(std::string(clinical_name(eye)) + ": " + flag.describe());
}

/// biometry.json with what is implausible in it told.
Json biometry_of(const FittedEye& fitted, Laterality eye, const MeshingOptions& options,
                 const std::optional<Measured>& interpupillary, StageWorkspace& workspace) {
  Json biometry = biometry_json(fitted.estimate, {options.retinal_depth_mm},
                                fitted.topography ? &*fitted.topography : nullptr);
  if (!fitted.cornea_withheld.empty()) withhold_cornea(biometry, fitted.cornea_withheld);
  if (!fitted.front_withheld.empty()) withhold_front(biometry, fitted.front_withheld);
  biometry["head_roll_deg"] = fitted.fit.at("head_roll_deg");
  if (interpupillary) biometry["interpupillary_distance_mm"] = *interpupillary;
  flag(biometry, eye, workspace);
  return biometry;
}

void warn_of_head_roll(const Json& roll, StageWorkspace& workspace) {
  if (roll.is_number() && !limits_of("head_roll_deg").plausible.contains(roll.get<double>()))
    workspace.warn(fmt::format(
        "the head is rolled by {:.1f} degrees against the scanner, in which astigmatic axes are given",
        roll.get<double>()));
}

StageVerdict mesh_eyes(const MeshingOptions& options, const StageVerdict& segmented,
                       const CommonOptions& common, StageWorkspace& workspace) {
  KnownEyes eyes = read_eyes(options, workspace);
  learn_from_instruments(eyes, options, workspace);
  const std::optional<Measured> interpupillary = interpupillary_distance(eyes, options.scale_sd);
  const OpticalDefaults defaults = optical_defaults(options.case_folder, options.retinal_depth_mm);
  if (!eyes.fitted.empty()) warn_of_head_roll(eyes.fitted.begin()->second.fit.at("head_roll_deg"), workspace);

  Json quality = Json::object();
  StageVerdict verdict = work_eye_by_eye(
      eyes_asked_for(common.laterality), {ExitStatus::done, segmented.reasons}, [&](Laterality eye) {
        if (const auto missing = eyes.missing.find(eye); missing != eyes.missing.end())
          throw no_result_error(missing->second);
        const fs::path folder = workspace.folder() / to_string(eye);
        fs::create_directories(folder);
        if (const auto read = eyes.read.find(eye); read != eyes.read.end()) {
          Json biometry = edge_biometry_json(read->second, eye, options.retinal_depth_mm);
          flag(biometry, eye, workspace);
          write_json(folder / "biometry.json", biometry);
          return;
        }
        const FittedEye& fitted = eyes.fitted.at(eye);
        quality[to_string(eye)] = write_meshes(folder, fitted, options);
        write_json(folder / "biometry.json", biometry_of(fitted, eye, options, interpupillary, workspace));
        if (fitted.has_optics()) write_json(folder / "optics.json", optics_json(fitted.estimate, defaults));
      });
  workspace.provenance()["meshes"] = quality;
  const bool something_withheld =
      std::any_of(eyes.fitted.begin(), eyes.fitted.end(),
                  [&](const auto& eye) {
                    return includes(common.laterality, eye.first) && !eye.second.has_optics();
                  }) ||
      std::any_of(eyes.read.begin(), eyes.read.end(),
                  [&](const auto& eye) { return includes(common.laterality, eye.first); });
  if (verdict.status == ExitStatus::done && something_withheld) verdict.status = ExitStatus::partial;
  return verdict;
}

/// Of readings that an earlier meshing had and this one has not: "OD (right): keratometry ... ".
std::vector<std::string> forgotten_readings(const MeshingOptions& options) {
  const fs::path file = options.case_folder / "meshing" / "stage.json";
  std::vector<std::string> sentences;
  try {
    if (!fs::exists(file)) return {};
    const Json before = read_json(file).at("parameters").at("instruments"),
               now = to_json(options.instruments);
    for (const Laterality eye : both_eyes) {
      const std::set<std::string> had = given_of(before, eye), has = given_of(now, eye);
      std::vector<std::string> lost;
      std::set_difference(had.begin(), had.end(), has.begin(), has.end(), std::back_inserter(lost));
      if (!lost.empty())
        sentences.push_back(fmt::format("{}: {}: given to the earlier meshing, and not to this one",
                                        clinical_name(eye), fmt::join(lost, ", ")));
    }
  } catch (const std::exception&) {  // what cannot be read is made again
  }
  return sentences;
}

}  // namespace

void MeshingOptions::check() const {
  for (const auto& [name, count] : vertices) {
    const auto& names = sheet_names;
    if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end())
      throw usage_error("--vertices: no surface is called " + name,
                        "expected " + fmt::format("{}", fmt::join(names, ", ")));
    if (count <= 0) throw usage_error(fmt::format("--vertices: {} vertices make no surface", count));
  }
  if (edge_mm < 0) throw usage_error(fmt::format("--edge-mm: an edge of {:g} mm is none", edge_mm));
}

Answer make_meshes(const MeshingOptions& options, const CommonOptions& common) {
  options.check();
  const StageVerdict segmented = read_verdict(options.case_folder, "segmentation");
  StageSpec spec;
  spec.stage = "meshing";
  spec.parameters = parameters_of(options, common);
  spec.inputs = inputs_of(options);
  const StageOutcome outcome = run_stage(options.case_folder, spec, common, [&](StageWorkspace& workspace) {
    for (const std::string& sentence : forgotten_readings(options)) workspace.warn(sentence);
    for (const auto& [side, readings] : options.instruments)
      if (!includes(common.laterality, side)) workspace.warn(readings_not_used(side));
    return mesh_eyes(options, segmented, common, workspace);
  });
  Answer answer = stage_answer(
      *stage_of_folder("meshing"), outcome, common, [&](Laterality eye) -> std::optional<EyeAnswer> {
        const fs::path file = options.case_folder / "meshing" / to_string(eye) / "biometry.json";
        if (!fs::exists(file)) return std::nullopt;
        const Json biometry = read_json(file);
        return EyeAnswer{biometry, std::string(clinical_name(eye)) + "\n" + summary(biometry)};
      });
  answer.json["meshes"] = outcome.stage_json.value("meshes", Json::object());
  return answer;
}

}  // namespace emmetrope::meshing
