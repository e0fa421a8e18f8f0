#include "pipeline/report/case/case_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <sstream>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/ends_with.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/iso_date.hpp"

namespace emmetrope::report {
namespace {

namespace fs = std::filesystem;

bool names_a_unit(const std::string& key) {
  static constexpr std::array<const char*, 6> units{"_mm", "_um", "_deg", "_D", "_nm", "_s"};
  return std::any_of(units.begin(), units.end(), [&](const char* unit) { return ends_with(key, unit); });
}

/// Keys that end in a unit hold numbers, and so do the parts of a measured number: said here once with file
/// and key, as whoever uses the number knows neither.
void require_numbers(const fs::path& file, const Json& json, const std::string& pointer, bool is_number) {
  if (json.is_structured()) {
    const bool is_measured = json.is_object() && json.contains("ci95");
    for (const auto& [key, value] : json.items())
      require_numbers(file, value, fmt::format("{}/{}", pointer, key),
                      (is_number && json.is_array()) || names_a_unit(key) ||
                          (is_measured && (key == "value" || key == "ci95")));
    for (const char* part : {"value", "source"})
      if (is_measured && !json.contains(part))
        throw input_error(
            fmt::format("{}: the measured number {} lacks \"{}\"", file.string(), pointer, part),
            "run the stage that writes it again, with --force");
  } else if (is_number && !json.is_number() && !json.is_null()) {
    throw input_error(
        fmt::format("{}: {} is {}, which is no number", file.string(), pointer, json.dump().substr(0, 60)),
        "run the stage that writes it again, with --force");
  }
}

Json json_if_there(const fs::path& file) {
  if (!fs::exists(file)) return nullptr;
  Json json = read_json(file);
  require_numbers(file, json, "", false);
  return json;
}

fs::path path_if_there(const fs::path& file) { return fs::exists(file) ? file : fs::path(); }

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
  return cells;
}

std::optional<Sweep> read_sweep(const fs::path& file) {
  if (!fs::exists(file)) return std::nullopt;
  std::istringstream stream(read_file(file));
  Sweep sweep;
  std::string line;
  while (std::getline(stream, line)) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    const auto cells = cells_of(line);
    if (sweep.names.empty()) {
      sweep.names = cells;
      continue;
    }
    std::vector<double> row;
    for (const auto& cell : cells) {
      double value = 0;
      const auto end = std::from_chars(cell.data(), cell.data() + cell.size(), value).ptr;
      if (end != cell.data() + cell.size())
        throw input_error(file.string() + ": \"" + cell + "\" is no number", "run emmetrope correct again");
      row.push_back(value);
    }
    if (row.size() != sweep.names.size())
      throw input_error(file.string() + ": a row of another length than its header",
                        "run emmetrope correct again");
    sweep.rows.push_back(row);
  }
  return sweep.rows.empty() ? std::nullopt : std::optional(sweep);
}

/// What no stage wrote: copies from other systems leave such files beside theirs (._NAME).
bool is_hidden(const fs::path& file) { return file.filename().string().front() == '.'; }

std::vector<fs::path> pictures_in(const fs::path& folder) {
  std::vector<fs::path> pictures;
  if (fs::is_directory(folder))
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().extension() == ".png" && !is_hidden(entry.path())) pictures.push_back(entry.path());
  std::sort(pictures.begin(), pictures.end());
  return pictures;
}

EyeData read_eye_data(const fs::path& folder, Laterality laterality, CaseExtent extent) {
  EyeData eye;
  eye.laterality = laterality;
  const std::string id = eye.id();
  eye.fit = json_if_there(folder / "segmentation" / id / "fit.json");
  eye.meshes = folder / "meshing" / id;
  eye.biometry = json_if_there(eye.meshes / "biometry.json");
  eye.optics = json_if_there(eye.meshes / "optics.json");
  eye.overlays = pictures_in(folder / "segmentation" / id);
  if (extent == CaseExtent::until_meshing) return eye;
  eye.wavefront = json_if_there(folder / "raytrace" / id / "wavefront.json");
  const Json tracing = json_if_there(folder / "raytrace" / "stage.json");
  if (const Json::json_pointer of_eye("/eyes/" + id); tracing.is_object() && tracing.contains(of_eye))
    eye.traced = tracing.at(of_eye);
  eye.uncorrected_png = path_if_there(folder / "raytrace" / id / "uncorrected.png");
  eye.prescription = json_if_there(folder / "correction" / id / "prescription.json");
  eye.corrected_png = path_if_there(folder / "correction" / id / "corrected.png");
  eye.sweep = read_sweep(folder / "correction" / id / "sweep.csv");
  return eye;
}

/// Parameters without the names of files that were typed (a scene, movements, a lens, a topography), which may name the
/// patient; names of charts and models stay.
Json without_file_names(Json parameters) {
  for (auto& [key, value] : parameters.items()) {
    if (value.is_structured()) value = without_file_names(std::move(value));
    if (!value.is_string()) continue;
    const std::string ending = fs::path(value.get<std::string>()).extension();
    if (key == "file" || key == "spectacle" || ending == ".json" || ending == ".csv" || ending == ".CSV")
      value = "[removed]";
  }
  return parameters;
}

std::optional<StageData> read_stage(const fs::path& folder, const std::string& name) {
  const fs::path file = folder / name / "stage.json";
  if (!fs::exists(file)) return std::nullopt;
  const Json json = read_json(file);
  try {
    StageData stage;
    stage.name = name;
    const StageVerdict verdict = read_verdict(folder, name);
    stage.status = verdict.status;
    stage.reasons = verdict.reasons;
    stage.warnings = json.value("warnings", std::vector<std::string>{});
    for (const char* key : {"version", "parameters", "seed", "opencl_device", "outputs"})
      if (json.contains(key)) stage.provenance[key] = json[key];
    if (stage.provenance.contains("parameters"))
      stage.provenance["parameters"] = without_file_names(stage.provenance["parameters"]);
    // Names of a study's files may name the patient: their hashes alone identify the input.
    std::string hashes;
    for (const auto& hash : json.value("inputs", Json::object())) hashes += hash.get<std::string>() + "\n";
    stage.provenance["inputs_sha256"] = sha256_of(hashes);
    return stage;
  } catch (const nlohmann::json::exception& fault) {
    throw input_error(file.string() + " is broken: " + fault.what(), "run the stage again");
  }
}

std::string text_of(const Json& json, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (json.is_object() && json.contains(key) && json[key].is_string()) return json[key].get<std::string>();
  return {};
}

}  // namespace

const StageData* CaseData::stage(const std::string& name) const {
  const auto found =
      std::find_if(stages.begin(), stages.end(), [&](const StageData& stage) { return stage.name == name; });
  return found == stages.end() ? nullptr : &*found;
}

std::string CaseData::subject() const {
  const Json subject = case_json.value("subject", Json::object());
  const std::string id = text_of(subject, {"id", "pseudonym"});
  return id.empty() ? "unknown" : id;
}

std::optional<double> CaseData::age_years() const {
  if (const auto of_study = value_at(case_json, "/subject/age_years")) return of_study;
  for (const auto& [name, key] :
       {std::pair{"correction", "/parameters/age_given_years"}, {"raytrace", "/parameters/age_years"}})
    if (const StageData* later = stage(name))
      if (const auto told = value_at(later->provenance, key)) return told;
  return {};
}

std::string CaseData::told_study_date() const {
  const std::string date = text_of(case_json, {"study_date", "date"});
  return date.empty() ? text_of(case_json.value("study", Json::object()), {"date", "study_date"}) : date;
}

std::string CaseData::study_date() const {
  const std::string date = told_study_date();
  const bool has_dashes = date.size() == 10 && date[4] == '-' && date[7] == '-';
  return iso_date(has_dashes ? date.substr(0, 4) + date.substr(5, 2) + date.substr(8) : date);
}

CaseData read_case(const fs::path& folder, LateralityChoice eyes, CaseExtent extent) {
  if (!fs::is_directory(folder))
    throw input_error("the case folder " + folder.string() + " does not exist",
                      "make it with: emmetrope run STUDY -o " + folder.string());
  CaseData data;
  data.folder = folder;
  for (const PipelineStage& stage : pipeline_stages) {
    if (stage.folder == std::string_view("report")) continue;
    if (auto read = read_stage(folder, stage.folder)) data.stages.push_back(std::move(*read));
    if (extent == CaseExtent::until_meshing && stage.folder == std::string_view("meshing")) break;
  }
  if (data.stage("segmentation") == nullptr)
    throw input_error("the case has no finished segmentation: " +
                          (folder / "segmentation" / "stage.json").string() + " is missing",
                      "make it with: emmetrope segment STUDY -o " + folder.string());
  data.case_json = json_if_there(folder / "case.json");
  if (!data.case_json.is_object()) data.case_json = Json::object();
  for (const Laterality eye : both_eyes)
    if (includes(eyes, eye)) data.eyes.push_back(read_eye_data(folder, eye, extent));
  for (const auto& entry : fs::directory_iterator(folder / "segmentation")) {
    const std::string name = entry.path().filename().string();
    if (ends_with(name, ".nii.gz") && !ends_with(name, "_labels.nii.gz") && !is_hidden(name))
      data.stacks.push_back(entry.path());
  }
  std::sort(data.stacks.begin(), data.stacks.end());
  data.overlays = pictures_in(folder / "segmentation");
  return data;
}

std::optional<Eigen::Vector3d> globe_centre(const EyeData& eye) {
  const Json fit = eye.fit.is_object() ? eye.fit : Json::object();
  const bool by_edges =
      fit.value("withheld", Json::object()).contains("fit") && fit.value("edges", Json()).is_object();
  const Json centre = (by_edges ? fit.at("edges") : fit).value("globe_centre_lps_mm", Json());
  if (centre.is_array() && centre.size() == 3)
    return Eigen::Vector3d(centre[0].get<double>(), centre[1].get<double>(), centre[2].get<double>());
  if (eye.biometry.is_object() && eye.biometry.contains("lps_from_eye")) {
    const Eigen::Isometry3d lps_from_eye = isometry_from_json(eye.biometry["lps_from_eye"]);
    return lps_from_eye * Eigen::Vector3d(0, 0, -value_of(eye.biometry, "axial_length_mm").value_or(24) / 2);
  }
  return std::nullopt;
}

Eigen::Vector3d head_shift(const EyeData& eye, const std::string& stack) {
  if (eye.fit.is_object())
    for (const auto& fitted : eye.fit.value("stacks", Json::array()))
      if (fitted.value("name", std::string()) == stack && fitted.contains("shift_lps_mm")) {
        const Json& shift = fitted["shift_lps_mm"];
        return {shift.at(0).get<double>(), shift.at(1).get<double>(), shift.at(2).get<double>()};
      }
  return Eigen::Vector3d::Zero();
}

bool is_fitted_to(const EyeData& eye, const std::string& stack) {
  const Json fit = eye.fit.is_object() ? eye.fit : Json::object(),
             stacks = fit.value("stacks", Json::array());
  return stacks.empty() || std::any_of(stacks.begin(), stacks.end(), [&](const Json& fitted) {
           return fitted.value("name", std::string()) == stack;
         });
}

std::optional<double> value_of(const Json& json, const std::string& key) { return value_at(json, "/" + key); }

std::optional<double> value_at(const Json& json, const std::string& pointer) {
  const Json::json_pointer at(pointer);
  if (!json.is_object() || !json.contains(at)) return std::nullopt;
  const Json& found = json.at(at);
  if (found.is_number()) return found.get<double>();
  if (found.is_object() && found.contains("value") && found["value"].is_number())
    return found["value"].get<double>();
  return std::nullopt;
}

std::optional<Measured> measured_in(const Json& json, const std::string& key) {
  const Json found = json.is_object() ? json.value(key, Json()) : Json();
  if (!found.is_object() || !found.contains("ci95")) return std::nullopt;
  return found.get<Measured>();
}

}  // namespace emmetrope::report
