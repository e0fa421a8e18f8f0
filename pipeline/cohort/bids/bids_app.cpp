#include "pipeline/cohort/bids/bids_app.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/progress.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/cohort/bids/derivatives.hpp"
#include "pipeline/cohort/results/cohort_results.hpp"
#include "pipeline/cohort/subjects/readings.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/subject_plan.hpp"
#include "pipeline/cohort/subjects/subjects.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

fs::path whole_path(const fs::path& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

/// "01" of "01", "sub-01" and, as shells complete it, "sub-01/".
std::string label_in(std::string word, const std::string& prefix) {
  while (!word.empty() && word.back() == '/') word.pop_back();
  if (word.rfind(prefix, 0) == 0) word.erase(0, prefix.size());
  const bool is_label = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '+';
  });
  if (!is_label)
    throw usage_error("\"" + prefix + word + "\" is no label of BIDS", "letters, digits and + make one");
  return word;
}

std::set<std::string> labels(const std::vector<std::string>& words, const std::string& prefix) {
  std::set<std::string> bare;
  for (const std::string& word : words) bare.insert(label_in(word, prefix));
  return bare;
}

/// What is written among the images of a person would be taken for one of them.
void require_apart(const fs::path& output, const fs::path& dataset) {
  const fs::path inner = output.lexically_relative(dataset);
  const bool is_among_images =
      !inner.empty() && (inner == "." || inner.begin()->string().rfind("sub-", 0) == 0);
  if (is_among_images)
    throw usage_error(output.string() + " lies among the images",
                      "name a folder beside them, such as BIDS_DIR/derivatives/emmetrope");
}

Json counted(const Outcomes& outcomes) {
  return {{"measured", outcomes.measured},
          {"partial", outcomes.partial},
          {"no_result", outcomes.no_result},
          {"failed", outcomes.failed}};
}

std::string said(const Outcomes& outcomes) {
  return fmt::format("{} eyes measured, {} in part, {} without a result, {} failed", outcomes.measured,
                     outcomes.partial, outcomes.no_result, outcomes.failed);
}

/// Warns where the dataset's own table does not speak of those who were measured, or are to be, as it did.
void compare_with_table(const fs::path& dataset, const std::vector<Subject>& subjects) {
  const fs::path file = dataset / "participants.tsv";
  if (!fs::exists(file)) return;
  try {
    for (const std::string& sentence : contradictions(subjects, read_table(file, {id_column})))
      spdlog::warn("{}", sentence);
  } catch (const Error& unreadable) {  // what was measured stands
    spdlog::warn("{}", unreadable.what());
  }
}

Answer run_participants(const BidsOptions& options, const CommonOptions& common) {
  const fs::path dataset = whole_path(options.dataset);
  const Derivatives derivatives(whole_path(options.output));
  require_bids(dataset);
  require_apart(derivatives.root(), dataset);
  const std::vector<Subject> subjects =
      find_subjects(dataset, {labels(options.participants, "sub-"), labels(options.sessions, "ses-")});
  compare_with_table(dataset, subjects);
  derivatives.describe(dataset);
  const CohortFolder cohort = derivatives.cohort();
  Progress progress(fmt::format("{} visits", subjects.size()), subjects.size() * pipeline_stages.size(),
                    common.verbosity);
  std::vector<std::string> names, of_the_machine;
  for (const Subject& subject : subjects) {
    const CaseLock alone(cohort.case_folder(subject.id), true);
    write_subject(cohort, subject, common);
    forget_ends_that_do_not_hold(cohort, subject.id);
    bool is_whole = true;
    for (const PipelineStage& stage : pipeline_stages) {
      const int status =
          run_stage_of(cohort, subject.id, stage.command, {1, 1, common.thread_count(), common.force});
      if (status != 0)
        throw Error(static_cast<ExitStatus>(status), std::string(stage.command) + " was interrupted",
                    "what is done is kept: the same command goes on");
      const StageEnd end = read_end(cohort, subject.id, stage.command);
      is_whole = is_whole && !(end.status && is_of_the_machine(*end.status));
      progress.advance();
    }
    names.push_back(subject.id);
    if (is_whole)
      derivatives.publish(subject, dataset);
    else
      of_the_machine.push_back(subject.id);
  }
  if (!of_the_machine.empty())
    throw Error(ExitStatus::fault,
                fmt::format("stages of {} failed for want of memory, disk or device",
                            fmt::join(of_the_machine, ", ")),
                "see " + (cohort.root() / "ends").string() + "; then run the same again");
  const std::vector<EyeRow> rows = read_rows(cohort, names);
  for (const std::string& sentence : doubts_about(rows)) spdlog::warn("{}", sentence);
  const Outcomes outcomes = count_outcomes(rows);
  Answer answer;
  answer.json = counted(outcomes);
  answer.json["participants"] = names;
  answer.text = said(outcomes) + "\n" + derivatives.root().string() + "\n";
  return answer;
}

Answer run_group(const BidsOptions& options) {
  const Derivatives derivatives(whole_path(options.output));
  const CohortFolder cohort = derivatives.cohort();
  std::vector<Subject> measured;
  std::error_code missing;
  std::size_t unfinished = 0;
  for (const auto& entry : fs::directory_iterator(cohort.root() / "subjects", missing)) {
    if (entry.path().extension() != ".json") continue;
    const std::string subject = entry.path().stem().string();
    try {
      if (is_finished(cohort, subject))
        measured.push_back(read_subject(cohort.subject_file(subject), subject));
    } catch (const Error& broken) {
      spdlog::warn("{}", broken.what());
    }
    if (measured.empty() || measured.back().id != subject) ++unfinished;
  }
  if (measured.empty())
    throw input_error(derivatives.root().string() + " holds no participant that is finished",
                      "run emmetrope bids BIDS_DIR OUT participant before");
  if (unfinished > 0)
    spdlog::warn("{} visits are left out: their participant level is not finished", unfinished);
  std::sort(measured.begin(), measured.end(), [](const Subject& a, const Subject& b) { return a.id < b.id; });
  std::vector<std::string> subjects;
  for (const Subject& subject : measured) subjects.push_back(subject.id);
  compare_with_table(whole_path(options.dataset), measured);
  const std::vector<EyeRow> rows = read_rows(cohort, subjects);
  for (const std::string& sentence : doubts_about(rows)) spdlog::warn("{}", sentence);
  write_results(cohort, rows, derivatives.root());
  const Outcomes outcomes = count_outcomes(rows);
  Answer answer;
  answer.json = counted(outcomes);
  answer.json["unfinished"] = unfinished;
  answer.json["table"] = (derivatives.root() / "cohort.tsv").string();
  answer.json["page"] = (derivatives.root() / "cohort.html").string();
  answer.text = said(outcomes) + "\n" + (derivatives.root() / "cohort.html").string() + "\n";
  return answer;
}

}  // namespace

Answer run_bids(const BidsOptions& options, const CommonOptions& common) {
  return options.level == "group" ? run_group(options) : run_participants(options, common);
}

}  // namespace emmetrope::cohort
