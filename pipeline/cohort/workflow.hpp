#pragma once
#include <filesystem>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/engine/engine.hpp"

namespace emmetrope::cohort {

struct CohortOptions {
  std::filesystem::path studies, output;
  EngineOptions engine;
};

/// Measures every study in `studies` (find_subjects) into cases below `output`, several at a time, by Snakemake on
/// this machine or through Slurm, and
/// writes the table and the page of all. What is done is not done again; one subject that fails does not stop others.
/// \return done; partial where subjects failed or gave less than all; no_result where none gave anything
/// \throw Error (usage) where Snakemake is missing, (fault) where it fails, with its log
Answer run_cohort(const CohortOptions& options, const CommonOptions& common);

}  // namespace emmetrope::cohort
