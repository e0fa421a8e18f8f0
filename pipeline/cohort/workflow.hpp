#pragma once
#include <filesystem>

#include "pipeline/base/command_line.hpp"

namespace emmetrope::cohort {

struct CohortOptions {
  std::filesystem::path studies, output;
  int jobs = 0;  ///< at the same time; 0: one a core
};

/// Measures every study in `studies` (find_subjects) into cases below `output`, several at a time, by Snakemake, and
/// writes the table and the page of all. What is done is not done again; one subject that fails does not stop others.
/// \return done; partial where subjects failed or gave less than all; no_result where none gave anything
/// \throw Error (usage) where Snakemake is missing, (fault) where it fails, with its log
Answer run_cohort(const CohortOptions& options, const CommonOptions& common);

}  // namespace emmetrope::cohort
