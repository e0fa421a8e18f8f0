#include "pipeline/base/up_to_date.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <vector>

#include "pipeline/base/files.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;

Json hashes_of(const std::vector<StageInput>& inputs) {
  Json hashes = Json::object();
  for (const auto& input : inputs) hashes[input.name] = sha256_of_file(input.path);
  return hashes;
}

StageVerdict verdict_from(const Json& stage_json) {
  const Json& verdict = stage_json.at("verdict");
  const Json& said = verdict.at("status");
  for (const ExitStatus status : {ExitStatus::done, ExitStatus::partial, ExitStatus::no_result})
    if (said == static_cast<int>(status))
      return {status, verdict.at("reasons").get<std::vector<std::string>>()};
  throw input_error(fmt::format("verdict.status is {}, not 0, 6 or 8", said.dump().substr(0, 60)));
}

std::vector<std::string> warnings_from(const Json& stage_json) {
  return stage_json.at("warnings").get<std::vector<std::string>>();
}

/// Whether one eye is asked for, and a stored result is of both.
bool is_part_of(const Json& stored, const Json& key) {
  const auto laterality = [](const Json& of) { return of.at("parameters").value("laterality", "both"); };
  return laterality(key) != "both" && laterality(stored) == "both";
}

/// Whether a stored result was made from the key, or for both eyes from the same where the key asks for one.
bool answers(const Json& stored, Json key) {
  if (is_part_of(stored, key)) {
    key["parameters"]["laterality"] = "both";
    for (const auto& [name, hash] : key["inputs"].items())
      if (stored.at("inputs").value(name, "") != hash) return false;
    key.erase("inputs");
  }
  for (const auto& [name, value] : key.items())
    if (stored.at(name) != value) return false;
  return true;
}

std::string command_for(const std::string& folder, const fs::path& case_folder) {
  const PipelineStage* stage = stage_of_folder(folder);
  return "emmetrope " + (stage == nullptr ? folder : stage->command) + " " +
         (folder == pipeline_stages.front().folder ? "STUDY -o " : "") + case_folder.string();
}

/// What a stage did not write is not of this eye, whatever its name: another patient's eye, copied here. Hidden files,
/// which desktops leave everywhere, are not read.
void require_no_strangers(const fs::path& case_folder, const std::string& stage, const Json& outputs) {
  for (const StageInput& file : inputs_below(case_folder, stage))
    if (!outputs.contains(file.name) && file.path.filename().string().front() != '.')
      throw input_error(
          fmt::format("{} was not written by {}", file.path.string(), stage),
          "move it elsewhere, or make all of it again with: " + command_for(stage, case_folder) + " --force");
}

/// A result that somebody has edited since must not pass for one that the program measured.
void require_own_outputs(const fs::path& case_folder, const std::string& stage, const Json& outputs) {
  for (const auto& [name, hash] : outputs.items()) {
    const fs::path file = case_folder / name;
    const bool is_there = fs::exists(file);
    if (is_there && sha256_of_file(file) == hash.get<std::string>()) continue;
    throw input_error(fmt::format("{} {} since {} wrote it", file.string(),
                                  is_there ? "has been changed" : "has been removed", stage),
                      "make it again with: " + command_for(stage, case_folder));
  }
  require_no_strangers(case_folder, stage, outputs);
}

/// A stage made from results that have been made anew since would mix two eyes: checked from the first stage on, as
/// what follows a stale one is to be made anew after it.
void require_same_inputs(const fs::path& case_folder, const std::string& stage, const Json& inputs) {
  if (stage == pipeline_stages.front().folder)
    return;  // its inputs are the study's files, under the study's names
  const auto top_of = [](const std::string& name) { return name.substr(0, name.find('/')); };
  std::set<std::string> read;
  for (const auto& [name, hash] : inputs.items()) read.insert(top_of(name));
  for (const PipelineStage& before : pipeline_stages) {
    if (stage == before.folder) break;
    if (read.count(before.folder) > 0) read_verdict(case_folder, before.folder);
  }
  for (const auto& [name, hash] : inputs.items()) {
    const std::string top = top_of(name);
    if (stage_of_folder(top) == nullptr) continue;
    const fs::path file = case_folder / name;
    if (!fs::exists(file) || sha256_of_file(file) != hash.get<std::string>())
      throw input_error(fmt::format("{} was made from another {}: {} {}", stage, top, file.string(),
                                    fs::exists(file) ? "has changed since" : "is gone"),
                        "make it again with: " + command_for(stage, case_folder));
  }
}

/// A forged stage.json may name any file.
bool lies_in_case(const fs::path& name) {
  return name.is_relative() && std::find(name.begin(), name.end(), "..") == name.end();
}

}  // namespace

Json key_of(const StageSpec& spec, const CommonOptions& common) {
  Json key{{"version", version()}, {"parameters", spec.parameters}, {"seed", common.seed}};
  if (spec.uses_opencl) key["device"] = spec.device;
  key["inputs"] = hashes_of(spec.inputs);
  return key;
}

void require_unchanged(const std::vector<StageInput>& inputs, const Json& noted) {
  for (const StageInput& input : inputs)
    if (!fs::exists(input.path) || sha256_of_file(input.path) != noted.at(input.name).get<std::string>())
      throw input_error(fmt::format("{} {} while it was read", input.path.string(),
                                    fs::exists(input.path) ? "changed" : "was removed"),
                        "run it again when nothing writes there any more");
}

void require_own_folder(const fs::path& case_folder, const std::string& stage) {
  const fs::path file = case_folder / stage / stage_file;
  const Json stage_json =
      fs::exists(file) ? Json::parse(read_file(file), nullptr, false) : Json{{"outputs", {}}};
  if (stage_json.is_object() && stage_json.contains("outputs"))  // else nothing tells what it wrote
    require_no_strangers(case_folder, stage, stage_json.at("outputs"));
}

std::optional<StageOutcome> finished(const fs::path& case_folder, const std::string& stage, const Json& key) {
  const fs::path file = case_folder / stage / stage_file;
  if (!fs::exists(file)) return std::nullopt;
  StageOutcome outcome;
  try {
    Json stored = read_json(file);
    if (!answers(stored, key)) return std::nullopt;
    // The other eye's part stands in the way of what follows where the stage before has dropped that eye.
    if (is_part_of(stored, key)) require_same_inputs(case_folder, stage, stored.at("inputs"));
    for (const auto& [name, hash] : stored.at("outputs").items())
      if (sha256_of_file(case_folder / name) != hash.get<std::string>()) return std::nullopt;
    for (const auto& warning : warnings_from(stored)) spdlog::warn("{}", warning);
    outcome = {verdict_from(stored), true, 0, std::move(stored)};
  } catch (const std::exception&) {
    return std::nullopt;  // unreadable or incomplete: make it again
  }
  require_no_strangers(case_folder, stage, outcome.stage_json.at("outputs"));
  return outcome;
}

StageVerdict read_verdict(const fs::path& case_folder, const std::string& stage) {
  const fs::path file = case_folder / stage / stage_file;
  const std::string remedy = "make it with: " + command_for(stage, case_folder);
  if (!fs::exists(file))
    throw input_error("the case has no finished " + stage + ": " + file.string() + " is missing", remedy);
  const auto broken = [&](const std::exception& fault) {
    return input_error(file.string() + " is broken: " + fault.what(), remedy);
  };
  try {
    const Json stage_json = read_json(file);
    StageVerdict verdict = verdict_from(stage_json);
    require_same_inputs(case_folder, stage, stage_json.value("inputs", Json::object()));
    if (stage_json.contains("outputs")) require_own_outputs(case_folder, stage, stage_json["outputs"]);
    return verdict;
  } catch (const nlohmann::json::exception& fault) {
    throw broken(fault);
  } catch (const Error& fault) {
    if (!fault.remedy().empty()) throw;
    throw broken(fault);
  }
}

bool is_as_written(const fs::path& case_folder, const std::string& stage) {
  const fs::path file = case_folder / stage / stage_file;
  if (!fs::exists(file)) return false;
  try {
    require_own_outputs(case_folder, stage, read_json(file).value("outputs", Json::object()));
    return true;
  } catch (const Error&) {
    return false;
  } catch (const Json::exception&) {  // somebody's stage.json
    return false;
  }
}

void remove_result(const fs::path& case_folder, const std::string& stage) {
  const fs::path folder = case_folder / stage, file = folder / stage_file;
  if (!fs::exists(file)) return;
  try {
    const Json stage_json = Json::parse(read_file(file), nullptr, false);
    const Json outputs =
        stage_json.is_object() ? stage_json.value("outputs", Json::object()) : Json::object();
    for (const auto& [name, hash] : outputs.items())
      if (lies_in_case(name) && fs::is_regular_file(case_folder / name) &&
          Json(sha256_of_file(case_folder / name)) == hash)
        fs::remove(case_folder / name);
    fs::remove(file);
    std::vector<fs::path> folders{folder};
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_directory()) folders.push_back(entry.path());
    std::sort(folders.rbegin(), folders.rend());  // what lies deeper first
    for (const fs::path& inner : folders)
      if (fs::is_empty(inner)) fs::remove(inner);
  } catch (const fs::filesystem_error& fault) {
    throw output_error("cannot remove the outdated " + folder.string() + ": " + fault.code().message());
  }
}

}  // namespace emmetrope
