#include "pipeline/cohort/workflow.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/cohort/results/cohort_results.hpp"
#include "pipeline/cohort/results/cohort_rows.hpp"
#include "pipeline/cohort/subjects/cohort_folder.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/subject_plan.hpp"
#include "pipeline/cohort/subjects/subjects.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

/// What is written into the studies would be a study of the next run, and a case may take no study's place.
void require_apart(const CohortFolder& cohort, const CohortOptions& options,
                   const std::vector<Subject>& subjects) {
  const auto lies_in = [&](const fs::path& folder) {
    const fs::path inner = fs::weakly_canonical(cohort.root()), outer = fs::canonical(folder);
    return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
  };
  for (const Subject& subject : subjects) {
    const fs::path study = fs::canonical(subject.study),
                   cases = fs::weakly_canonical(cohort.case_folder(subject.id).parent_path());
    if (std::mismatch(cases.begin(), cases.end(), study.begin(), study.end()).first == cases.end())
      throw usage_error("-o: the study " + subject.study.string() + " lies among its cases",
                        "name another folder, or another one's studies");
  }
  const bool is_inside = (fs::is_directory(options.studies) && lies_in(options.studies)) ||
                         std::any_of(subjects.begin(), subjects.end(),
                                     [&](const Subject& subject) { return lies_in(subject.study); });
  if (is_inside)
    throw usage_error("-o: " + options.output.string() + " lies in the studies", "name a folder beside them");
}

void write_plan(const CohortFolder& cohort, const std::vector<Subject>& subjects,
                const CommonOptions& common) {
  fs::create_directories(cohort.root());
  std::string list;
  for (const Subject& subject : subjects) {
    write_subject(cohort, subject, common);
    list += subject.id + "\n";
  }
  write_if_new(cohort.root() / "subjects.txt", list);
}

/// Jobs that did not begin, or were ended from outside at every attempt (by a limit of memory or time), have left no end.
void end_what_left_none(const CohortFolder& cohort, const std::vector<Subject>& subjects) {
  for (const Subject& subject : subjects) {
    bool is_first = true;
    for (const PipelineStage& stage : pipeline_stages) {
      const fs::path file = cohort.end_file(subject.id, stage.command);
      if (fs::exists(file)) continue;
      StageEnd end{std::nullopt, "", plan_hash(cohort, subject.id)};
      if (is_first) {
        end.status = static_cast<int>(ExitStatus::fault);
        end.message = why_no_end(cohort.log_file(subject.id, stage.command));
      }
      is_first = false;
      fs::create_directories(file.parent_path());
      write_json(file, to_json(end));
    }
  }
}

}  // namespace

Answer run_cohort(const CohortOptions& options, const CommonOptions& common) {
  require_engine(options.engine);
  const std::vector<Subject> subjects = find_subjects(options.studies);
  const CohortFolder cohort(fs::absolute(options.output).lexically_normal());
  require_apart(cohort, options, subjects);
  const CaseLock lock(cohort.root(), true);
  write_plan(cohort, subjects, common);
  for (const Subject& subject : subjects)
    // Snakemake makes a file that is missing only where one that follows is missing too.
    if (forget_ends_that_do_not_hold(cohort, subject.id)) fs::remove(cohort.root() / "cohort.tsv");
  Workflow workflow{data_folder() / "pipeline/cohort/Snakefile",
                    cohort.root(),
                    fmt::format("{} subjects", subjects.size()),
                    {}};
  for (const Subject& subject : subjects)
    for (const PipelineStage& stage : pipeline_stages)
      workflow.jobs.emplace(cohort.end_file(subject.id, stage.command),
                            cohort.log_file(subject.id, stage.command));
  const bool is_whole = run_workflow(workflow, options.engine, common);
  if (!is_whole) end_what_left_none(cohort, subjects);
  const std::vector<EyeRow> rows = read_rows(cohort, listed_subjects(cohort));
  if (!is_whole) write_results(cohort, rows, cohort.root());
  const std::vector<std::string> doubts = doubts_about(rows);
  for (const std::string& sentence : doubts) spdlog::warn("{}", sentence);
  const Outcomes outcomes = count_outcomes(rows);
  Answer answer;
  answer.status = outcomes.measured == rows.size()           ? ExitStatus::done
                  : outcomes.measured + outcomes.partial > 0 ? ExitStatus::partial
                                                             : ExitStatus::no_result;
  const fs::path page = cohort.root() / "cohort.html";
  answer.json = {{"status", static_cast<int>(answer.status)},
                 {"subjects", subjects.size()},
                 {"eyes", rows.size()},
                 {"measured", outcomes.measured},
                 {"partial", outcomes.partial},
                 {"no_result", outcomes.no_result},
                 {"failed", outcomes.failed},
                 {"warnings", doubts},
                 {"table", (cohort.root() / "cohort.tsv").string()},
                 {"page", page.string()}};
  answer.text = fmt::format(
      "{} subjects, {} eyes: {} measured, {} in part, {} without a result, {} failed\n{}\n", subjects.size(),
      rows.size(), outcomes.measured, outcomes.partial, outcomes.no_result, outcomes.failed, page.string());
  return answer;
}

}  // namespace emmetrope::cohort
