#pragma once
#include <filesystem>
#include <map>
#include <string>

#include "pipeline/base/command_line.hpp"

namespace CLI {
class App;
}

namespace emmetrope::cohort {

/// What runs a workflow's jobs.
enum class Engine { local, slurm };

struct EngineOptions {
  Engine engine = Engine::local;
  int jobs = 0;  ///< at the same time; 0: one a core, and 500 in Slurm's queue
};
/// --engine and --jobs
void declare(CLI::App& app, EngineOptions& options);

/// A workflow of Snakemake's.
struct Workflow {
  std::filesystem::path snakefile, folder;  ///< folder: where it works
  std::string doing;                        ///< in the user's words: "20 subjects"
  /// The log of each job by the file that it leaves at its end.
  std::map<std::filesystem::path, std::filesystem::path> jobs;
};

/// FOLDER/snakemake.log: what the engine said.
std::filesystem::path engine_log(const std::filesystem::path& folder);

/// \throw Error (usage) where Snakemake or Slurm's commands are missing, (fault) where Slurm's controller does not answer
void require_engine(const EngineOptions& options);

/// Runs what is not done yet, several jobs at a time; a job that fails does not stop the others. Jobs of the folder that
/// Slurm is running already are waited for before. With --force all is done again, and the workflow's config has "force".
/// \return whether every job gave its files in one of its attempts
/// \throw Error (fault) where the engine itself fails or could begin no job, with the end of its log
bool run_workflow(const Workflow& workflow, const EngineOptions& options, const CommonOptions& common);

/// Why a job of a workflow that has been run left no end.
/// \param log  of the job, which writes into it when it begins
std::string why_no_end(const std::filesystem::path& log);

}  // namespace emmetrope::cohort
