#pragma once
#include <filesystem>
#include <vector>

#include "pipeline/cohort/results/cohort_rows.hpp"

namespace emmetrope::cohort {

/// Writes cohort.json, cohort.html and, last, cohort.tsv into `folder`.
/// \throw Error (not_writable)
void write_results(const CohortFolder& cohort, const std::vector<EyeRow>& rows,
                   const std::filesystem::path& folder);

}  // namespace emmetrope::cohort
