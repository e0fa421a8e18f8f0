#pragma once
#include <string>
#include <vector>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/subjects/cohort_folder.hpp"
#include "pipeline/cohort/subjects/subjects.hpp"

namespace emmetrope::cohort {

/// The words that hand seed, device and laterality on to other commands.
std::vector<std::string> shared_options(const CommonOptions& common);

/// Writes what is to be done for a subject, with what all stages are asked for (seed, device, laterality). A file that
/// says so already stays as it is: Snakemake redoes what comes after a file that is newer.
void write_subject(const CohortFolder& cohort, Subject subject, const CommonOptions& common);

/// Writes `text` unless the file holds it already.
void write_if_new(const std::filesystem::path& file, const std::string& text);

}  // namespace emmetrope::cohort
