#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/base/json.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"
#include "pipeline/cohort/sweep/sweep_table.hpp"

namespace emmetrope::cohort {

/// Where things are in OUT of `emmetrope sweep TABLE -o OUT`.
struct SweepFolder {
  std::filesystem::path root;
  std::filesystem::path list() const { return root / "runs.txt"; }
  std::filesystem::path plan(const std::string& run) const { return root / "plans" / (run + ".json"); }
  std::filesystem::path results(const std::string& run) const { return root / "results" / run; }
  std::filesystem::path log(const std::string& run) const { return root / "logs" / (run + ".log"); }
  std::filesystem::path end(const std::string& run) const { return root / "ends" / (run + ".json"); }
};

/// What is done in one run: {"command", "words", "files": {path: SHA-256}, "version"}. Two runs with the same plan give
/// the same result.
Json sweep_plan(const Sweep& sweep, const std::vector<Setting>& settings,
                const std::vector<std::string>& shared);
/// Name of a run: 12 digits of its plan's hash.
std::string run_name(const Json& plan);

/// Runs one and writes its end, {"status", "message", "result"}: the JSON that the command wrote or answered. What the
/// machine is at fault for is an end only when it was the last attempt.
/// \return 0, or the command's status where there is to be another attempt
int run_of_sweep(const SweepFolder& folder, const std::string& run, const Attempt& attempt);

}  // namespace emmetrope::cohort
