#include "pipeline/base/case_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>

#include "pipeline/base/files.hpp"
#include "pipeline/base/interrupt.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/up_to_date.hpp"

namespace emmetrope {
namespace {

namespace fs = std::filesystem;

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

/// A stage is one result with one set of parameters: what it holds of an eye that this run leaves out goes.
void warn_of_lost_eye(const fs::path& stage_folder, LateralityChoice asked, StageWorkspace& workspace) {
  for (const Laterality eye : both_eyes)
    if (!includes(asked, eye) && fs::exists(stage_folder / to_string(eye)))
      workspace.warn(
          fmt::format("{}: its earlier {} is dropped, as this run is for the other eye alone; run it "
                      "without --laterality to have both",
                      clinical_name(eye), stage_folder.filename().string()));
}

}  // namespace

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
  if (!common.force) require_own_folder(case_folder, spec.stage);

  const fs::path folder = case_folder / (".writing-" + spec.stage);
  const RemoveOnInterrupt guard(folder);
  try {
    fs::remove_all(folder);
    fs::create_directory(folder);
    StageWorkspace workspace(folder);
    warn_of_lost_eye(case_folder / spec.stage, common.laterality, workspace);
    const StageVerdict verdict = work(workspace);
    require_unchanged(spec.inputs, key.at("inputs"));

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
