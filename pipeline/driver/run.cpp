#include "pipeline/driver/run.hpp"

#include <fmt/format.h>

#include <optional>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/process.hpp"

namespace emmetrope::driver {
namespace {

namespace fs = std::filesystem;

struct Stage {
  std::string command;  ///< "segment"
  std::string folder;   ///< "segmentation"
  std::vector<std::string> arguments;
};

struct StageReport {
  Stage stage;
  ProcessResult process;
  bool skipped = false;
  std::vector<std::string> reasons;  ///< why it gave no result or a partial one
};

/// As an argument: a folder named "-case" is no option.
std::string as_argument(const fs::path& path) {
  return path.string().rfind('-', 0) == 0 ? "./" + path.string() : path.string();
}

std::vector<std::string> common_arguments(const CommonOptions& common) {
  std::vector<std::string> words{"--json", "--seed", std::to_string(common.seed)};
  if (common.force) words.emplace_back("--force");
  if (common.verbosity.quiet) words.emplace_back("--quiet");
  if (!common.device.empty()) words.insert(words.end(), {"--device", common.device});
  if (common.threads > 0) words.insert(words.end(), {"--threads", std::to_string(common.threads)});
  if (common.laterality != LateralityChoice::both)
    words.insert(words.end(), {"--laterality", common.laterality == LateralityChoice::od ? "od" : "os"});
  return words;
}

std::vector<Stage> stages_of(const RunOptions& options, const CommonOptions& common) {
  const std::string folder = as_argument(options.case_folder);
  std::vector<Stage> stages;
  for (const PipelineStage& stage : pipeline_stages)
    stages.push_back({stage.command, stage.folder, {folder}});
  stages.front().arguments = {as_argument(options.study), "-o", folder};
  const std::array<const std::vector<std::string>*, 5> own{&options.segment_options, &options.mesh_options,
                                                           &options.trace_options, &options.correct_options,
                                                           &options.report_options};
  for (std::size_t i = 0; i < stages.size(); ++i) {
    auto& words = stages[i].arguments;
    words.insert(words.end(), own[i]->begin(), own[i]->end());
    const auto shared = common_arguments(common);
    words.insert(words.end(), shared.begin(), shared.end());
  }
  return stages;
}

/// A stage that had nothing to do leaves its stage.json untouched.
std::optional<fs::file_time_type> time_of_result(const fs::path& case_folder, const Stage& stage) {
  std::error_code missing;
  const auto time = fs::last_write_time(case_folder / stage.folder / "stage.json", missing);
  return missing ? std::nullopt : std::optional(time);
}

StageReport run_one(const Stage& stage, const fs::path& case_folder) {
  const auto before = time_of_result(case_folder, stage);
  StageReport report{stage,
                     run_process(executable_folder() / ("emmetrope-" + stage.command), stage.arguments,
                                 ChildOutput::capture),
                     false,
                     {}};
  report.skipped = before.has_value() && before == time_of_result(case_folder, stage);
  if (report.process.status == static_cast<int>(ExitStatus::no_result) ||
      report.process.status == static_cast<int>(ExitStatus::partial))
    report.reasons = read_verdict(case_folder, stage.folder).reasons;
  return report;
}

/// What a stage said of its failure, on standard error and, as JSON, on standard output.
Error failure_of(const Stage& stage, const ProcessResult& ended, const char* what = "failed") {
  const std::string kept = "what is done is kept: the same command goes on from there";
  if (ended.status == static_cast<int>(ExitStatus::interrupted) ||
      ended.status == static_cast<int>(ExitStatus::terminated))
    return {static_cast<ExitStatus>(ended.status), "the stage " + stage.command + " was interrupted", kept};
  if (ended.status >= 128)
    return {ExitStatus::fault,
            fmt::format("the stage {} was ended by signal {}", stage.command, ended.status - 128), kept};
  const Json answer = Json::parse(ended.output, nullptr, false);
  const Json said = answer.is_object() ? answer.value("error", Json::object()) : Json::object();
  return {
      static_cast<ExitStatus>(ended.status),
      fmt::format("the stage {} {}: {}", stage.command, what, said.value("message", "its message is above")),
      said.value("remedy", kept)};
}

/// A device that is not there is told before the first stage works for a minute.
void check_device(const CommonOptions& common) {
  if (common.device.empty()) return;
  const Stage devices{"devices", {}, {"--json", "--quiet", "--device", common.device}};
  const ProcessResult asked =
      run_process(executable_folder() / "emmetrope-devices", devices.arguments, ChildOutput::capture);
  if (asked.status != 0) throw failure_of(devices, asked);
}

std::string outcome_of(const StageReport& report) {
  std::string text;
  switch (static_cast<ExitStatus>(report.process.status)) {
    case ExitStatus::no_result:
      text = "no result: the data do not support one";
      break;
    case ExitStatus::partial:
      text = "partial result";
      break;
    default:
      return report.skipped ? "up to date, skipped" : "done";
  }
  if (report.skipped) text += " (up to date, skipped)";
  for (const auto& reason : report.reasons) text += "\n    " + reason;
  return text;
}

bool gave_result(int status) {
  return status == static_cast<int>(ExitStatus::done) || status == static_cast<int>(ExitStatus::partial);
}

Answer answer_of(const std::vector<StageReport>& reports, ExitStatus status, const fs::path& case_folder) {
  Answer answer;
  answer.status = status;
  answer.json =
      Json{{"status", static_cast<int>(status)}, {"case", case_folder.string()}, {"stages", Json::array()}};
  double total_s = 0;
  for (const auto& report : reports) {
    answer.json["stages"].push_back(Json{{"stage", report.stage.command},
                                         {"status", report.process.status},
                                         {"skipped", report.skipped},
                                         {"reasons", report.reasons},
                                         {"wall_s", report.process.wall_s},
                                         {"peak_memory_MB", report.process.peak_memory_MB}});
    answer.text += fmt::format("{:<9}{:>7.1f} s {:>6.0f} MB  {}\n", report.stage.command,
                               report.process.wall_s, report.process.peak_memory_MB, outcome_of(report));
    total_s += report.process.wall_s;
  }
  answer.text += fmt::format("{:<9}{:>7.1f} s\n", "total", total_s);
  answer.json["wall_s"] = total_s;
  const fs::path report = fs::absolute(case_folder / "report" / "report.html").lexically_normal();
  answer.json["report"] = report.string();
  answer.text += "report: " + report.string() + "\n";
  return answer;
}

/// What a stage would refuse of its options after the minutes that those before it take.
void check_options(const std::vector<Stage>& stages) {
  for (const Stage& stage : stages) {
    std::vector<std::string> words = stage.arguments;
    words.emplace_back("--check-options");
    const ProcessResult asked =
        run_process(executable_folder() / ("emmetrope-" + stage.command), words, ChildOutput::capture);
    if (asked.status != 0) throw failure_of(stage, asked, "refuses its options");
  }
}

}  // namespace

Answer run_pipeline(const RunOptions& options, const CommonOptions& common) {
  check_device(common);
  const std::vector<Stage> stages = stages_of(options, common);
  check_options(stages);
  const CaseLock lock(options.case_folder, true);
  std::vector<StageReport> reports;
  ExitStatus status = ExitStatus::done;
  bool has_ended = false;  // a stage gave nothing for those after it
  for (const Stage& stage : stages) {
    if (has_ended && stage.command != "report") {
      // What it left in an earlier run would contradict the new report.
      remove_result(options.case_folder, stage.folder);
      continue;
    }
    spdlog::info("{} ...", stage.command);
    reports.push_back(run_one(stage, options.case_folder));
    const int ended = reports.back().process.status;
    if (gave_result(ended)) {
      if (ended != 0 && status == ExitStatus::done) status = ExitStatus::partial;
    } else if (ended == static_cast<int>(ExitStatus::no_result)) {
      has_ended = true;
      // Biometry of an eye that light cannot be traced through is a result in part.
      const bool something_was_measured = stage.command != "segment" && stage.command != "mesh";
      status = something_was_measured ? ExitStatus::partial : ExitStatus::no_result;
    } else {
      throw failure_of(stage, reports.back().process);
    }
  }
  return answer_of(reports, status, options.case_folder);
}

}  // namespace emmetrope::driver
