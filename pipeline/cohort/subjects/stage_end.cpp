#include "pipeline/cohort/subjects/stage_end.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <boost/algorithm/string/replace.hpp>
#include <iterator>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/base/up_to_date.hpp"

namespace emmetrope::cohort {
namespace {

constexpr int no_result = static_cast<int>(ExitStatus::no_result);

std::size_t place_of(const std::string& stage) {
  const auto found = std::find_if(pipeline_stages.begin(), pipeline_stages.end(),
                                  [&](const PipelineStage& one) { return one.command == stage; });
  if (found == pipeline_stages.end()) throw usage_error("no stage is called \"" + stage + "\"");
  return static_cast<std::size_t>(std::distance(pipeline_stages.begin(), found));
}

/// Whether a stage has anything to do after those before it: a report tells of an eye without a result too.
bool has_work(const CohortFolder& cohort, const std::string& subject, std::size_t stage) {
  for (std::size_t before = 0; before < stage; ++before) {
    const StageEnd end = read_end(cohort, subject, pipeline_stages[before].command);
    if (!end.status) continue;
    if (gave_result(*end.status)) continue;
    if (*end.status != no_result || stage + 1 != pipeline_stages.size()) return false;
  }
  return true;
}

bool is_there(const CohortFolder& cohort, const std::string& subject, const PipelineStage& stage) {
  return std::filesystem::exists(cohort.case_folder(subject) / stage.folder / stage_file);
}

/// Whether a stage before failed and left the case as it was, so that what this one left earlier may hold still.
bool is_interrupted_before(const CohortFolder& cohort, const std::string& subject, std::size_t stage) {
  for (std::size_t before = 0; before < stage; ++before) {
    const StageEnd end = read_end(cohort, subject, pipeline_stages[before].command);
    if (!end.status || came_to_its_end(*end.status)) continue;
    if (is_of_the_machine(*end.status) || is_there(cohort, subject, pipeline_stages[before])) return true;
  }
  return false;
}

bool holds(const CohortFolder& cohort, const std::string& subject, const PipelineStage& stage,
           const std::string& plan) {
  try {
    const StageEnd end = read_end(cohort, subject, stage.command);
    if (end.plan != plan) return false;
    if (!end.status) return true;
    if (is_of_the_machine(*end.status)) return false;
    // Of data at fault nothing is left.
    return came_to_its_end(*end.status) == is_there(cohort, subject, stage);
  } catch (const Error&) {
    return false;
  }
}

std::string message_of(const ProcessResult& ended, const std::filesystem::path& case_folder,
                       const char* folder) {
  if (ended.status == 0) return {};
  if (came_to_its_end(ended.status))
    return fmt::format("{}", fmt::join(read_verdict(case_folder, folder).reasons, "\n"));
  return message_of_failure(ended);
}

}  // namespace

bool gave_result(int status) {
  return status == static_cast<int>(ExitStatus::done) || status == static_cast<int>(ExitStatus::partial);
}

bool came_to_its_end(int status) { return gave_result(status) || status == no_result; }

bool was_interrupted(int status) {
  return status == static_cast<int>(ExitStatus::interrupted) ||
         status == static_cast<int>(ExitStatus::terminated);
}

std::string message_of_failure(const ProcessResult& ended) {
  if (ended.status >= 128) return fmt::format("ended by signal {}", ended.status - 128);
  const Json answer = Json::parse(ended.output, nullptr, false);
  const Json said = answer.is_object() ? answer.value("error", Json::object()) : Json::object();
  return said.value("message", fmt::format("ended with status {}", ended.status));
}

bool has_come_to_its_end(const CohortFolder& cohort, const std::string& subject, std::string_view stage) {
  try {
    const StageEnd end = read_end(cohort, subject, stage);
    return end.status && came_to_its_end(*end.status);
  } catch (const Error&) {  // broken, or not there
    return false;
  }
}

std::string plan_hash(const CohortFolder& cohort, const std::string& subject) {
  return sha256_of_file(cohort.subject_file(subject));
}

bool is_of_the_machine(int status) {
  return status == static_cast<int>(ExitStatus::fault) ||
         status == static_cast<int>(ExitStatus::not_writable) ||
         status == static_cast<int>(ExitStatus::no_device) || status >= 128;
}

Json to_json(const StageEnd& end) {
  return {{"status", end.status ? Json(*end.status) : Json(nullptr)},
          {"message", end.message},
          {"plan", end.plan}};
}

StageEnd read_end(const CohortFolder& cohort, const std::string& subject, std::string_view stage) {
  const auto file = cohort.end_file(subject, stage);
  const Json json = read_json(file);
  try {
    const Json& status = json.at("status");
    return {status.is_null() ? std::nullopt : std::optional(status.get<int>()),
            json.at("message").get<std::string>(), json.value("plan", std::string())};
  } catch (const Json::exception& fault) {
    throw input_error(file.string() + ": " + fault.what(), "remove it and run emmetrope cohort again");
  }
}

bool forget_ends_that_do_not_hold(const CohortFolder& cohort, const std::string& subject) {
  bool has_forgotten = false;
  const std::string plan = plan_hash(cohort, subject);
  for (const PipelineStage& stage : pipeline_stages) {
    const std::filesystem::path file = cohort.end_file(subject, stage.command);
    if (!std::filesystem::exists(file)) continue;
    has_forgotten = has_forgotten || !holds(cohort, subject, stage, plan);
    if (has_forgotten) std::filesystem::remove(file);
  }
  return has_forgotten;
}

int run_stage_of(const CohortFolder& cohort, const std::string& subject, const std::string& stage,
                 const Attempt& attempt) {
  const std::size_t place = place_of(stage);
  const auto end_file = cohort.end_file(subject, stage);
  std::filesystem::create_directories(end_file.parent_path());
  const std::string plan = plan_hash(cohort, subject);
  if (!has_work(cohort, subject, place)) {
    const std::filesystem::path earlier = cohort.case_folder(subject);
    const char* folder = pipeline_stages[place].folder;
    if (!is_interrupted_before(cohort, subject, place) && is_as_written(earlier, folder))
      remove_result(earlier, folder);
    write_json(end_file, to_json(StageEnd{std::nullopt, "", plan}));
    return 0;
  }
  const Subject asked = read_subject(cohort.subject_file(subject), subject);
  const std::filesystem::path case_folder = cohort.case_folder(subject);
  std::vector<std::string> words{case_folder.string()};
  if (place == 0) words = {asked.study.string(), "-o", case_folder.string()};
  if (const auto own = asked.options.find(stage); own != asked.options.end())
    words.insert(words.end(), own->second.begin(), own->second.end());
  words.insert(words.end(), {"--json", "--quiet", "--threads", std::to_string(attempt.threads)});
  if (attempt.force) words.emplace_back("--force");
  const ProcessResult ended =
      run_process(executable_folder() / ("emmetrope-" + stage), words, ChildOutput::capture);
  if (was_interrupted(ended.status)) return ended.status;
  if (is_of_the_machine(ended.status) && attempt.number < attempt.of) return ended.status;
  const char* folder = pipeline_stages[place].folder;
  std::string message = message_of(ended, case_folder, folder);
  boost::replace_all(message, asked.study.string(), "the study");  // a folder may be named after the patient
  boost::replace_all(message, "the case " + case_folder.string(), "the case");
  boost::replace_all(message, case_folder.string(), "the case");
  const bool is_of_the_data = !came_to_its_end(ended.status) && !is_of_the_machine(ended.status);
  if (is_of_the_data && is_as_written(case_folder, folder))  // what an earlier run left is of another input
    remove_result(case_folder, folder);
  write_json(end_file, to_json(StageEnd{ended.status, message, plan}));
  return 0;
}

}  // namespace emmetrope::cohort
