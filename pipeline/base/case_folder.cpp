#include "pipeline/base/case_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <set>
#include <thread>

#include "pipeline/base/files.hpp"
#include "pipeline/base/interrupt.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/version.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;

constexpr const char* lock_name = ".lock";
constexpr const char* lock_variable =
    "EMMETROPE_CASE_LOCK";  // "<descriptor>" that a driver hands to its stages
constexpr const char* stage_file = "stage.json";

bool is_same_file(int descriptor, const fs::path& file) {
  struct stat held {};
  struct stat wanted {};
  return ::fstat(descriptor, &held) == 0 && ::stat(file.c_str(), &wanted) == 0 &&
         held.st_dev == wanted.st_dev && held.st_ino == wanted.st_ino;
}

/// The driver's lock, where this process was started by one and it is for the same case.
std::optional<int> inherited_lock(const fs::path& lock_file) {
  const char* text = std::getenv(lock_variable);
  if (text == nullptr) return std::nullopt;
  const int descriptor = static_cast<int>(std::strtol(text, nullptr, 10));
  return is_same_file(descriptor, lock_file) ? std::optional(descriptor) : std::nullopt;
}

/// The processes of a run that was killed hold its lock until the system has taken them down: wait a moment
/// for that.
bool lock_soon(int descriptor) {
  constexpr auto patience = std::chrono::seconds(3);
  const auto start = std::chrono::steady_clock::now();
  while (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK || std::chrono::steady_clock::now() - start > patience) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

/// Forces a file's bytes or a folder's entries to disk, so that what was renamed survives a power cut.
void sync(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

/// Puts `fresh` in the place of `final` in one step where the file system can (Linux 3.15, renameat2).
void replace_folder(const fs::path& fresh, const fs::path& final) {
  constexpr unsigned exchange = 2;  // RENAME_EXCHANGE
  if (!fs::exists(final)) {
    fs::rename(fresh, final);
  } else if (::syscall(SYS_renameat2, AT_FDCWD, fresh.c_str(), AT_FDCWD, final.c_str(), exchange) != 0) {
    const fs::path old = fresh.string() + ".old";
    fs::rename(final, old);
    fs::rename(fresh, final);
    fs::remove_all(old);
    return;
  }
  fs::remove_all(fresh);
}

Json hashes_of(const std::vector<StageInput>& inputs) {
  Json hashes = Json::object();
  for (const auto& input : inputs) hashes[input.name] = sha256_of_file(input.path);
  return hashes;
}

/// What a result depends on. The seed is part of it, threads and verbosity are not.
Json key_of(const StageSpec& spec, const CommonOptions& common) {
  Json key{{"version", version()}, {"parameters", spec.parameters}, {"seed", common.seed}};
  if (spec.uses_opencl) key["device"] = spec.device;
  key["inputs"] = hashes_of(spec.inputs);
  return key;
}

StageVerdict verdict_from(const Json& stage_json) {
  const Json& verdict = stage_json.at("verdict");
  const auto status = static_cast<ExitStatus>(verdict.at("status").get<int>());
  if (status != ExitStatus::done && status != ExitStatus::partial && status != ExitStatus::no_result)
    throw input_error(fmt::format("verdict.status is {}, not 0, 6 or 8", static_cast<int>(status)));
  return {status, verdict.at("reasons").get<std::vector<std::string>>()};
}

std::vector<std::string> warnings_from(const Json& stage_json) {
  return stage_json.at("warnings").get<std::vector<std::string>>();
}

/// Whether a stored result was made from the key, or for both eyes from the same where the key asks for one.
bool answers(const Json& stored, Json key) {
  const auto laterality = [](const Json& of) { return of.at("parameters").value("laterality", "both"); };
  const bool is_part = laterality(key) != "both" && laterality(stored) == "both";
  if (is_part) {
    key["parameters"]["laterality"] = "both";
    for (const auto& [name, hash] : key["inputs"].items())
      if (stored.at("inputs").value(name, "") != hash) return false;
    key.erase("inputs");
  }
  for (const auto& [name, value] : key.items())
    if (stored.at(name) != value) return false;
  return true;
}

/// The stored outcome, if it answers the key and its outputs are still what was written.
std::optional<StageOutcome> finished(const fs::path& case_folder, const std::string& stage, const Json& key) {
  const fs::path file = case_folder / stage / stage_file;
  if (!fs::exists(file)) return std::nullopt;
  try {
    Json stored = read_json(file);
    if (!answers(stored, key)) return std::nullopt;
    for (const auto& [name, hash] : stored.at("outputs").items())
      if (sha256_of_file(case_folder / name) != hash.get<std::string>()) return std::nullopt;
    for (const auto& warning : warnings_from(stored)) spdlog::warn("{}", warning);
    return StageOutcome{verdict_from(stored), true, 0, std::move(stored)};
  } catch (const std::exception&) {
    return std::nullopt;  // unreadable or incomplete: make it again
  }
}

/// A stage is one result with one set of parameters: what it holds of an eye that this run leaves out goes.
void warn_of_lost_eye(const fs::path& stage_folder, LateralityChoice asked, StageWorkspace& workspace) {
  for (const Laterality eye : both_eyes)
    if (!includes(asked, eye) && fs::exists(stage_folder / to_string(eye)))
      workspace.warn(
          fmt::format("{}: its earlier {} is dropped, as this run is for the other eye alone; run it "
                      "without --laterality to have both",
                      clinical_name(eye), stage_folder.filename().string()));
}

/// Left over from runs that were killed; nobody else writes while we hold the lock.
void remove_leftovers(const fs::path& case_folder) {
  for (const auto& entry : fs::directory_iterator(case_folder)) {
    const std::string name = entry.path().filename().string();
    if (name.rfind(".writing-", 0) == 0) fs::remove_all(entry.path());
  }
}

std::string command_for(const std::string& folder, const fs::path& case_folder) {
  const PipelineStage* stage = stage_of_folder(folder);
  return "emmetrope " + (stage == nullptr ? folder : stage->command) + " " +
         (folder == pipeline_stages.front().folder ? "STUDY -o " : "") + case_folder.string();
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
}

/// A stage made from results that have been made anew since would mix two eyes: checked up to the first
/// stage.
void require_same_inputs(const fs::path& case_folder, const std::string& stage, const Json& inputs) {
  if (stage == pipeline_stages.front().folder)
    return;  // its inputs are the study's files, under the study's names
  std::set<std::string> stages_before;
  for (const auto& [name, hash] : inputs.items()) {
    const std::string top = name.substr(0, name.find('/'));
    if (stage_of_folder(top) == nullptr) continue;
    stages_before.insert(top);
    const fs::path file = case_folder / name;
    if (!fs::exists(file) || sha256_of_file(file) != hash.get<std::string>())
      throw input_error(fmt::format("{} was made from another {}: {} {}", stage, top, file.string(),
                                    fs::exists(file) ? "has changed since" : "is gone"),
                        "make it again with: " + command_for(stage, case_folder));
  }
  for (const std::string& before : stages_before) read_verdict(case_folder, before);
}

}  // namespace

bool looks_like_a_case(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / "case.json", ignored)) return true;
  return std::any_of(pipeline_stages.begin(), pipeline_stages.end(), [&](const PipelineStage& stage) {
    return fs::exists(folder / stage.folder / stage_file, ignored);
  });
}

CaseLock::CaseLock(const fs::path& case_folder, bool create) : folder_(case_folder) {
  std::error_code fault;
  if (create) created_ = fs::create_directories(case_folder, fault);
  if (fault)
    throw output_error("cannot make the case folder " + case_folder.string() + ": " + fault.message());
  if (!fs::is_directory(case_folder))
    throw input_error("the case folder " + case_folder.string() + " does not exist",
                      "make it with: emmetrope segment STUDY -o " + case_folder.string());
  if (!create && !looks_like_a_case(case_folder))
    throw input_error(case_folder.string() + " is no case: it holds neither case.json nor a finished stage",
                      "make one with: emmetrope segment STUDY -o " + case_folder.string());
  const fs::path lock_file = case_folder / lock_name;
  if (const auto inherited = inherited_lock(lock_file)) {
    descriptor_ = *inherited;
    inherited_ = true;
    return;
  }
  descriptor_ = ::open(lock_file.c_str(), O_RDWR | O_CREAT, 0644);
  if (descriptor_ < 0)
    throw output_error("cannot write in the case folder " + case_folder.string() + ": " +
                       std::strerror(errno));
  // A lock on a file that its last holder has just removed would keep nobody out.
  if (!lock_soon(descriptor_) || !is_same_file(descriptor_, lock_file)) {
    ::close(descriptor_);
    throw output_error("the case " + case_folder.string() + " is in use by another run",
                       "wait for it to end, or write to another folder");
  }
  ::setenv(lock_variable, std::to_string(descriptor_).c_str(), 1);
  remove_leftovers(case_folder);
}

CaseLock::~CaseLock() {
  if (inherited_) return;
  ::unsetenv(lock_variable);
  std::error_code ignored;
  if (!looks_like_a_case(folder_)) {  // nothing came of it: the folder is left as it was found
    fs::remove(folder_ / lock_name, ignored);
    if (created_) fs::remove(folder_, ignored);  // an empty one
  }
  ::close(descriptor_);
}

fs::path StageWorkspace::case_file(const std::string& name) {
  case_files_.push_back(name);
  return folder_ / (".case-" + name);
}

void StageWorkspace::warn(const std::string& text) {
  spdlog::warn("{}", text);
  warnings_.push_back(text);
}

StageOutcome run_stage(const fs::path& case_folder, const StageSpec& spec, const CommonOptions& common,
                       const std::function<StageVerdict(StageWorkspace&)>& work) {
  const auto start = std::chrono::steady_clock::now();
  const CaseLock lock(case_folder, true);
  const Json key = key_of(spec, common);
  if (!common.force)
    if (auto stored = finished(case_folder, spec.stage, key)) return std::move(*stored);

  const fs::path folder = case_folder / (".writing-" + spec.stage);
  const RemoveOnInterrupt guard(folder);
  try {
    fs::remove_all(folder);
    fs::create_directory(folder);
    StageWorkspace workspace(folder);
    warn_of_lost_eye(case_folder / spec.stage, common.laterality, workspace);
    const StageVerdict verdict = work(workspace);

    Json outputs = Json::object();
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file() && entry.path().filename().string().rfind(".case-", 0) != 0)
        files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    for (const auto& file : files) {
      sync(file);
      outputs[(spec.stage / fs::relative(file, folder)).string()] = sha256_of_file(file);
    }
    for (const auto& name : workspace.case_files())
      outputs[name] = sha256_of_file(folder / (".case-" + name));

    const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    Json stage_json{{"stage", spec.stage}, {"command_line", common.command_line}};
    stage_json.update(key);
    stage_json["outputs"] = outputs;
    stage_json["opencl_device"] = spec.uses_opencl ? Json(spec.device) : Json(nullptr);
    stage_json["wall_s"] = wall_s;
    stage_json["warnings"] = workspace.warnings();
    stage_json["verdict"] = Json{{"status", static_cast<int>(verdict.status)}, {"reasons", verdict.reasons}};
    stage_json.update(workspace.provenance());
    write_json(folder / stage_file, stage_json);

    {
      const auto together = hold_interrupts();
      for (const auto& name : workspace.case_files())
        fs::rename(folder / (".case-" + name), case_folder / name);
      replace_folder(folder, case_folder / spec.stage);
      sync(case_folder);
    }
    return {verdict, false, wall_s, stage_json};
  } catch (const fs::filesystem_error& fault) {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
    throw output_error(std::string("cannot write the result of ") + spec.stage + ": " + fault.what());
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
    throw;
  }
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
    require_own_outputs(case_folder, stage, stage_json.value("outputs", Json::object()));
    return verdict;
  } catch (const nlohmann::json::exception& fault) {
    throw broken(fault);
  } catch (const Error& fault) {
    if (!fault.remedy().empty()) throw;
    throw broken(fault);
  }
}

std::vector<StageInput> inputs_below(const fs::path& case_folder, const std::string& subfolder) {
  std::vector<StageInput> inputs;
  const fs::path folder = case_folder / subfolder;
  if (!fs::is_directory(folder)) return inputs;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && entry.path().filename() != stage_file)
      inputs.push_back({fs::relative(entry.path(), case_folder).string(), entry.path()});
  std::sort(inputs.begin(), inputs.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return inputs;
}

std::string describe(const std::string& stage, const StageOutcome& outcome, Verbosity verbosity) {
  if (verbosity.quiet) return {};
  return outcome.skipped ? stage + ": up to date, skipped\n"
                         : fmt::format("{}: done in {:.1f} s\n", stage, outcome.wall_s);
}

}  // namespace emmetrope
