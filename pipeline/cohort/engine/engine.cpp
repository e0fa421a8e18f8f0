#include "pipeline/cohort/engine/engine.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "pipeline/base/files.hpp"
#include "pipeline/base/process.hpp"
#include "pipeline/base/progress.hpp"

namespace emmetrope::cohort {
namespace {

namespace fs = std::filesystem;

/// Counts the files that are there while the engine works.
class Watch {
 public:
  Watch(std::string doing, std::set<fs::path> waited_for, Verbosity verbosity)
      : thread_([this, doing = std::move(doing), waited_for = std::move(waited_for), verbosity]() mutable {
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

long memory_of_machine_mb() { return ::sysconf(_SC_PHYS_PAGES) / 1024 * ::sysconf(_SC_PAGE_SIZE) / 1024; }

/// Where jobs run, and how many at a time.
std::vector<std::string> engine_words(const EngineOptions& options, const CommonOptions& common) {
  if (options.engine == Engine::slurm) {
    constexpr int jobs_in_queue = 500;
    return {"--profile", (data_folder() / "pipeline/cohort/engine/slurm").string(), "--jobs",
            std::to_string(options.jobs > 0 ? options.jobs : jobs_in_queue)};
  }
  return {"--cores", std::to_string(options.jobs > 0 ? options.jobs : common.thread_count()), "--resources",
          fmt::format("mem_mb={}", memory_of_machine_mb()), "--rerun-incomplete"};
}

std::string last_lines(const fs::path& log, std::size_t count) {
  const std::string text = fs::exists(log) ? read_file(log) : "";
  std::size_t from = text.size();
  for (std::size_t lines = 0; from > 0 && lines <= count; --from)
    if (text[from - 1] == '\n') ++lines;
  return text.substr(from);
}

/// \return Snakemake's status
int run_snakemake(const Workflow& workflow, const EngineOptions& options, const CommonOptions& common) {
  std::vector<std::string> words = engine_words(options, common);
  words.insert(words.begin(), "snakemake");
  words.insert(words.end(), {"--snakefile", workflow.snakefile.string(), "--directory",
                             workflow.folder.string(), "--keep-going", "--nolock", "--rerun-triggers",
                             "mtime", "--config", "bin=" + executable_folder().string()});
  for (const auto& [name, value] : workflow.settings) words.push_back(fmt::format("{}={}", name, value));
  if (common.force) words.insert(words.end(), {"force=1", "--forceall"});
  std::string line = "exec";
  for (const std::string& word : words) line += " " + in_shell(word);
  line += " >" + in_shell(engine_log(workflow.folder).string()) + " 2>&1";
  return run_process("/bin/sh", {"-c", line}, ChildOutput::inherit).status;
}

}  // namespace

void declare(CLI::App& app, EngineOptions& options) {
  app.add_option("--engine", options.engine, "What runs the jobs: local (this machine) or slurm")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, Engine>{{"local", Engine::local}, {"slurm", Engine::slurm}}))
      ->type_name("ENGINE");
  app.add_option("--jobs", options.jobs, "At the same time (one a core; 500 in Slurm's queue)")
      ->check(CLI::PositiveNumber)
      ->type_name("N");
}

fs::path engine_log(const fs::path& folder) { return folder / "snakemake.log"; }

void require_engine(const EngineOptions& options) {
  if (!find_program("snakemake"))
    throw usage_error("snakemake, which runs the jobs, is not on the PATH",
                      "install it: apt install --no-install-recommends snakemake");
  if (options.engine == Engine::local) return;
  for (const char* program : {"sbatch", "scontrol", "scancel"})
    if (!find_program(program))
      throw usage_error(std::string(program) + ", a command of Slurm, is not on the PATH",
                        "run it where jobs are given to the cluster (Debian: slurm-client)");
}

void run_workflow(const Workflow& workflow, const EngineOptions& options, const CommonOptions& common) {
  if (options.engine == Engine::slurm) fs::create_directories(workflow.folder / "slurm");  // what jobs say
  int status = 0;
  {
    const Watch watch(workflow.doing, workflow.waited_for, common.verbosity);
    status = run_snakemake(workflow, options, common);
  }
  if (status != 0)
    throw Error(
        ExitStatus::fault,
        fmt::format("snakemake ended with {}: {}", status, last_lines(engine_log(workflow.folder), 5)),
        "its log is " + engine_log(workflow.folder).string() +
            "; what is done is kept: the same command goes on");
}

}  // namespace emmetrope::cohort
