#pragma once
#include <filesystem>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/engine/engine.hpp"

namespace emmetrope::cohort {

struct SweepOptions {
  std::filesystem::path table, output;
  EngineOptions engine;
};

/// Runs every combination of a parameter study (read_sweep) that is not done yet, several at a time, and writes
/// OUT/sweep.tsv, a row a run.
/// \return done; partial where runs failed, no_result where all did
/// \throw Error (input_invalid) naming file, line and key, before any run an option or a column that the command does
///   not have, or, with the table written, columns that turned out to be none; (usage), (fault) as run_workflow
Answer run_sweep(const SweepOptions& options, const CommonOptions& common);

}  // namespace emmetrope::cohort
