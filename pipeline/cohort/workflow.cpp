#include "pipeline/cohort/workflow.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <set>
#include <sstream>
#include <thread>

#include "pipeline/base/case_folder.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/base/progress.hpp"
#include "pipeline/base/stages.hpp"
#include "pipeline/cohort/results/cohort_rows.hpp"
#include "pipeline/cohort/subjects/cohort_folder.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/subjects/subjects.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

void require_snakemake() {
  if (!find_program("snakemake"))
    throw usage_error("snakemake, which runs cohorts, is not on the PATH",
                      "install it: apt install --no-install-recommends snakemake");
}

/// What is written into the studies would be a study of the next run.
void require_apart(const CohortFolder& cohort, const CohortOptions& options,
                   const std::vector<Subject>& subjects) {
  const auto lies_in = [&](const fs::path& folder) {
    const fs::path inner = fs::weakly_canonical(cohort.root()), outer = fs::canonical(folder);
    return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
  };
  const bool is_inside = (fs::is_directory(options.studies) && lies_in(options.studies)) ||
                         std::any_of(subjects.begin(), subjects.end(),
                                     [&](const Subject& subject) { return lies_in(subject.study); });
  if (is_inside)
    throw usage_error("-o: " + options.output.string() + " lies in the studies", "name a folder beside them");
}

/// A fault of the machine is tried again by each run, and what comes after it: Snakemake makes a file that is missing only
/// where one that follows is missing too.
void forget_faults_of_the_machine(const CohortFolder& cohort, const std::vector<Subject>& subjects) {
  for (const Subject& subject : subjects) {
    bool is_to_be_redone = false;
    for (const PipelineStage& stage : pipeline_stages) {
      const fs::path file = cohort.end_file(subject.id, stage.command);
      if (!fs::exists(file)) continue;
      const StageEnd end = read_end(cohort, subject.id, stage.command);
      is_to_be_redone = is_to_be_redone || (end.status && is_of_the_machine(*end.status));
      if (is_to_be_redone) fs::remove(file);
    }
    if (is_to_be_redone) fs::remove(cohort.root() / "cohort.tsv");
  }
}

/// What all stages are asked for.
std::vector<std::string> shared_options(const CommonOptions& common) {
  std::vector<std::string> words{"--seed", std::to_string(common.seed)};
  if (!common.device.empty()) words.insert(words.end(), {"--device", common.device});
  if (common.laterality != LateralityChoice::both)
    words.insert(words.end(), {"--laterality", to_string(common.laterality)});
  return words;
}

/// Writes what changed only: Snakemake redoes what comes after a file that is newer.
void write_if_new(const fs::path& file, const std::string& text) {
  if (!fs::exists(file) || read_file(file) != text) write_file(file, text);
}

void write_plan(const CohortFolder& cohort, std::vector<Subject> subjects, const CommonOptions& common) {
  fs::create_directories(cohort.root() / "subjects");
  fs::create_directories(cohort.engine_log().parent_path());
  std::string list;
  const std::vector<std::string> shared = shared_options(common);
  for (Subject& subject : subjects) {
    for (const PipelineStage& stage : pipeline_stages) {
      std::vector<std::string>& words = subject.options[stage.command];
      words.insert(words.end(), shared.begin(), shared.end());
    }
    write_if_new(cohort.subject_file(subject.id), to_json(subject).dump(2) + "\n");
    list += subject.id + "\n";
  }
  write_if_new(cohort.root() / "subjects.txt", list);
}

/// Counts the ends of stages while the engine works.
class Watch {
 public:
  Watch(const CohortFolder& cohort, std::vector<Subject> subjects, Verbosity verbosity)
      : thread_([this, cohort, subjects = std::move(subjects), verbosity] {
          std::set<fs::path> waited_for;
          for (const Subject& subject : subjects)
            for (const PipelineStage& stage : pipeline_stages)
              waited_for.insert(cohort.end_file(subject.id, stage.command));
          Progress progress(fmt::format("{} subjects", subjects.size()), waited_for.size(), verbosity);
          for (bool last = false; !last; std::this_thread::sleep_for(std::chrono::milliseconds(200))) {
            last = over_;
            for (auto file = waited_for.begin(); file != waited_for.end();) {
              if (!fs::exists(*file)) {
                ++file;
              } else {
                file = waited_for.erase(file);
                progress.advance();
              }
            }
          }
        }) {}
  ~Watch() {
    over_ = true;
    thread_.join();
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

 private:
  std::atomic<bool> over_{false};
  std::thread thread_;
};

std::string in_shell(const std::string& word) {
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

long memory_of_machine_mb() { return ::sysconf(_SC_PHYS_PAGES) / 1024 * ::sysconf(_SC_PAGE_SIZE) / 1024; }

/// \return Snakemake's status
int run_engine(const CohortFolder& cohort, const CohortOptions& options, const CommonOptions& common) {
  std::vector<std::string> words{"snakemake",
                                 "--snakefile",
                                 (data_folder() / "pipeline/cohort/Snakefile").string(),
                                 "--directory",
                                 cohort.root().string(),
                                 "--cores",
                                 std::to_string(options.jobs > 0 ? options.jobs : common.thread_count()),
                                 "--resources",
                                 fmt::format("mem_mb={}", memory_of_machine_mb()),
                                 "--keep-going",
                                 "--nolock",
                                 "--rerun-incomplete",
                                 "--rerun-triggers",
                                 "mtime",
                                 "--config",
                                 "bin=" + executable_folder().string()};
  if (common.force) words.insert(words.end(), {"force=1", "--forceall"});
  std::string line = "exec";
  for (const std::string& word : words) line += " " + in_shell(word);
  line += " >" + in_shell(cohort.engine_log().string()) + " 2>&1";
  return run_process("/bin/sh", {"-c", line}, ChildOutput::inherit).status;
}

std::string last_lines(const fs::path& log, std::size_t count) {
  const std::string text = fs::exists(log) ? read_file(log) : "";
  std::size_t from = text.size();
  for (std::size_t lines = 0; from > 0 && lines <= count; --from)
    if (text[from - 1] == '\n') ++lines;
  return text.substr(from);
}

}  // namespace

Answer run_cohort(const CohortOptions& options, const CommonOptions& common) {
  require_snakemake();
  const std::vector<Subject> subjects = find_subjects(options.studies);
  const CohortFolder cohort(fs::absolute(options.output).lexically_normal());
  require_apart(cohort, options, subjects);
  const CaseLock lock(cohort.root(), true);
  write_plan(cohort, subjects, common);
  forget_faults_of_the_machine(cohort, subjects);
  int status = 0;
  {
    const Watch watch(cohort, subjects, common.verbosity);
    status = run_engine(cohort, options, common);
  }
  if (status != 0)
    throw Error(
        ExitStatus::fault,
        fmt::format("snakemake ended with {}: {}", status, last_lines(cohort.engine_log(), 5)),
        "its log is " + cohort.engine_log().string() + "; what is done is kept: the same command goes on");
  const std::vector<EyeRow> rows = read_rows(cohort);
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
                 {"table", (cohort.root() / "cohort.tsv").string()},
                 {"page", page.string()}};
  answer.text = fmt::format(
      "{} subjects, {} eyes: {} measured, {} in part, {} without a result, {} failed\n{}\n", subjects.size(),
      rows.size(), outcomes.measured, outcomes.partial, outcomes.no_result, outcomes.failed, page.string());
  return answer;
}

}  // namespace emmetrope::cohort
