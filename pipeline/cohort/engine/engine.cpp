#include "pipeline/cohort/engine/engine.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <set>
#include <thread>
#include <vector>

#include "pipeline/base/files.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/log.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/base/progress.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

std::set<fs::path> ends_of(const Workflow& workflow) {
  std::set<fs::path> ends;
  for (const auto& [end, log] : workflow.jobs) ends.insert(end);
  return ends;
}

/// Counts the files that are there while the engine works.
class Watch {
 public:
  Watch(const Workflow& workflow, Verbosity verbosity)
      : thread_([this, doing = workflow.doing, waited_for = ends_of(workflow), verbosity]() mutable {
          Progress progress(doing, waited_for.size(), verbosity);
          while (true) {
            const bool is_last = over_;
            const auto begin = std::chrono::steady_clock::now();
            for (auto file = waited_for.begin(); file != waited_for.end();) {
              if (!fs::exists(*file)) {
                ++file;
              } else {
                file = waited_for.erase(file);
                progress.advance();
              }
            }
            if (is_last) return;
            // Looking takes at most a hundredth of the time, however many files there are.
            const auto next = std::max<std::chrono::steady_clock::duration>(
                std::chrono::milliseconds(200), 100 * (std::chrono::steady_clock::now() - begin));
            for (const auto until = std::chrono::steady_clock::now() + next;
                 !over_ && std::chrono::steady_clock::now() < until;)
              std::this_thread::sleep_for(std::chrono::milliseconds(100));
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

/// Of the machine, or of the container that this runs in.
long memory_mb() {
  const long machine = ::sysconf(_SC_PHYS_PAGES) / 1024 * ::sysconf(_SC_PAGE_SIZE) / 1024;
  long long limit_bytes = 0;
  std::ifstream limit("/sys/fs/cgroup/memory.max");  // "max" where there is none
  return limit >> limit_bytes ? std::min(machine, static_cast<long>(limit_bytes >> 20)) : machine;
}

/// By which Slurm's jobs of a folder are known.
std::string job_name(const fs::path& folder) {
  constexpr std::size_t digits = 12;
  return "emmetrope-" + sha256_of(fs::weakly_canonical(folder).string()).substr(0, digits);
}

/// A job that runs knows nothing of a new workflow, which would start the same work beside it; those that only wait in the
/// queue Snakemake finds again itself.
void wait_for_running_jobs(const fs::path& folder) {
  const fs::path squeue = find_program("squeue").value_or("squeue");
  for (bool is_told = false;; std::this_thread::sleep_for(std::chrono::seconds(2))) {
    const ProcessResult jobs = run_process(squeue,
                                           {"--noheader", "--states=RUNNING,COMPLETING,CONFIGURING,SUSPENDED",
                                            "--format=%i", "--name=" + job_name(folder)},
                                           ChildOutput::capture);
    if (jobs.status != 0 || jobs.output.empty()) return;
    if (!is_told) spdlog::info("waiting for jobs of this folder that Slurm is running");
    is_told = true;
  }
}

/// Where jobs run, and how many at a time.
std::vector<std::string> engine_words(const EngineOptions& options, const CommonOptions& common) {
  if (options.engine == Engine::slurm) {
    constexpr int jobs_in_queue = 500;
    return {"--profile", (data_folder() / "pipeline/cohort/engine/slurm").string(), "--jobs",
            std::to_string(options.jobs > 0 ? options.jobs : jobs_in_queue)};
  }
  return {"--cores", std::to_string(options.jobs > 0 ? options.jobs : common.thread_count()), "--resources",
          fmt::format("mem_mb={}", memory_mb()), "--rerun-incomplete"};
}

std::string last_lines(const fs::path& log, std::size_t count) {
  std::string text = fs::exists(log) ? read_file(log) : "";
  if (!text.empty() && text.back() == '\n') text.pop_back();
  std::size_t from = text.size();
  for (; from > 0; --from)
    if (text[from - 1] == '\n' && --count == 0) break;
  return text.substr(from);
}

/// What sbatch said last; where it took the jobs, the end of Snakemake's log.
std::string last_words(const fs::path& log) {
  const std::string text = read_file(log);
  const std::size_t before = text.rfind("\nsbatch: ");
  if (before == std::string::npos) return last_lines(log, 5);
  return text.substr(before + 1, text.find('\n', before + 1) - before - 1);
}

/// What an earlier attempt said does not tell whether the next one begins.
/// \return logs of the jobs that are to be done
std::vector<fs::path> without_earlier_logs(const Workflow& workflow, bool force) {
  std::vector<fs::path> logs;
  for (const auto& [end, log] : workflow.jobs)
    if (force || !fs::exists(end)) {
      fs::remove(log);
      logs.push_back(log);
    }
  return logs;
}

/// Snakemake makes the log of a job that failed without it, but leaves it empty.
bool has_begun(const fs::path& log) {
  std::error_code missing;
  const std::uintmax_t size = fs::file_size(log, missing);
  return !missing && size > 0;
}

Error no_job_began(const Workflow& workflow, Engine engine) {
  const std::string logs = "its log is " + engine_log(workflow.folder).string();
  return {
      ExitStatus::fault, "no job began: " + last_words(engine_log(workflow.folder)),
      engine == Engine::local
          ? logs
          : logs + ", what jobs said is in " + (workflow.folder / "slurm").string() +
                "; SBATCH_PARTITION and SBATCH_ACCOUNT say where jobs go: try sbatch --test-only --wrap true"};
}

/// \return Snakemake's status
int run_snakemake(const Workflow& workflow, const EngineOptions& options, const CommonOptions& common) {
  std::vector<std::string> words = engine_words(options, common);
  words.insert(words.begin(), "snakemake");
  words.insert(words.end(),
               {"--snakefile", workflow.snakefile.string(), "--directory", workflow.folder.string(),
                "--keep-going", "--nolock", "--rerun-triggers", "mtime"});
  if (common.force) words.insert(words.end(), {"--config", "force=1", "--forceall"});
  write_json(workflow.folder / "engine.json", {{"bin", executable_folder().string()}});
  // The user's own profile is for the user's own workflows; what Snakemake keeps goes where it may write.
  std::string line = "unset SNAKEMAKE_PROFILE; export XDG_CACHE_HOME=" +
                     in_shell((workflow.folder / ".snakemake/cache").string()) +
                     " SBATCH_JOB_NAME=" + job_name(workflow.folder) + "; exec";
  for (const std::string& word : words) line += " " + in_shell(word);
  line += " >" + in_shell(engine_log(workflow.folder).string()) + " 2>&1";
  return run_process("/bin/sh", {"-c", line}, ChildOutput::inherit).status;
}

}  // namespace

void declare(CLI::App& app, EngineOptions& options) {
  constexpr int most_jobs = 100'000;
  app.add_option_function<std::string>(
         "--engine",
         [&options](const std::string& name) {
           options.engine = name == "slurm" ? Engine::slurm : Engine::local;
         },
         "What runs the jobs: local (this machine) or slurm")
      ->check(CLI::IsMember({"local", "slurm"}))
      ->type_name("ENGINE");
  app.add_option("--jobs", options.jobs, "At the same time (one a core; 500 in Slurm's queue)")
      ->check(CLI::Range(1, most_jobs))
      ->type_name("N");
}

fs::path engine_log(const fs::path& folder) { return folder / "snakemake.log"; }

void require_engine(const EngineOptions& options) {
  if (!find_program("snakemake"))
    throw usage_error("snakemake, which runs the jobs, is not on the PATH",
                      "install it: apt install --no-install-recommends snakemake");
  if (options.engine == Engine::local) return;
  for (const char* program : {"sbatch", "scontrol", "squeue", "scancel"})
    if (!find_program(program))
      throw usage_error(std::string(program) + ", a command of Slurm, is not on the PATH",
                        "run it where jobs are given to the cluster (Debian: slurm-client)");
  const ProcessResult ping = run_process(*find_program("scontrol"), {"ping"}, ChildOutput::capture);
  if (ping.status != 0)
    throw Error(ExitStatus::fault,
                "Slurm's controller does not answer: " +
                    (ping.output.empty() ? fmt::format("scontrol ping ended with {}", ping.status)
                                         : ping.output.substr(0, ping.output.find('\n'))),
                "run it where scontrol ping says UP; SLURM_CONF names the cluster's configuration");
}

bool run_workflow(const Workflow& workflow, const EngineOptions& options, const CommonOptions& common) {
  if (options.engine == Engine::slurm) {
    fs::create_directories(workflow.folder / "slurm");  // what jobs say
    wait_for_running_jobs(workflow.folder);
  }
  const std::vector<fs::path> logs = without_earlier_logs(workflow, common.force);
  int status = 0;
  {
    const Watch watch(workflow, common.verbosity);
    status = run_snakemake(workflow, options, common);
  }
  if (status == 0) return true;
  const bool jobs_failed =
      fs::exists(engine_log(workflow.folder)) &&
      read_file(engine_log(workflow.folder)).find("Exiting because a job execution failed") !=
          std::string::npos;
  if (!jobs_failed)
    throw Error(
        ExitStatus::fault,
        fmt::format("snakemake ended with {}: {}", status, last_lines(engine_log(workflow.folder), 5)),
        "its log is " + engine_log(workflow.folder).string() +
            "; what is done is kept: the same command goes on");
  if (!logs.empty() && std::none_of(logs.begin(), logs.end(), has_begun))
    throw no_job_began(workflow, options.engine);
  return false;
}

std::string why_no_end(const fs::path& log) {
  return has_begun(log) ? "was ended from outside at every attempt: out of memory or time?"
                        : "no attempt of it began: snakemake.log says why";
}

}  // namespace emmetrope::cohort
