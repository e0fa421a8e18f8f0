#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/base/command_line.hpp"

namespace emmetrope::driver {

/// Options of `emmetrope run`; those of a stage are handed to it as they were typed.
struct RunOptions {
  std::filesystem::path study;
  std::filesystem::path case_folder;
  std::vector<std::string> segment_options, mesh_options, trace_options, correct_options, report_options;
};

/// Runs segment, mesh, trace, correct and report on a case, each as a process of its own that redoes only
/// what is stale, under one lock. A stage without result (status 6) is followed by the report that says so;
/// one that fails ends the run.
Answer run_pipeline(const RunOptions& options, const CommonOptions& common);

}  // namespace emmetrope::driver
