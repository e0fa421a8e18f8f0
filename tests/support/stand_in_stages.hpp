#pragma once
#include <filesystem>
#include <map>
#include <string>

#include "pipeline/base/process.hpp"
#include "pipeline/base/stages.hpp"

namespace emmetrope::test {

/// Copies of the commands of cohorts, with shell scripts for stages beside them, all below one folder.
class StandInStages {
 public:
  /// \param folder  exists
  explicit StandInStages(std::filesystem::path folder);

  /// "cohort" or "bids" with these words, its standard output captured.
  ProcessResult run(const std::string& command, const std::vector<std::string>& words) const;
  std::filesystem::path program(const std::string& command) const { return bin() / ("emmetrope-" + command); }

  /// The status that a stage of a subject ends with from now on, or "kill", which ends what called it; 0 where none is told. That of `COMMAND.once` is for
  /// one time.
  void tell(const std::string& subject, const std::string& stage, const std::string& status) const;
  void forget(const std::string& subject, const std::string& stage) const;
  /// A stage takes a second from now on, or no longer.
  void slow(bool is_slow) const;
  /// How often each stage of each subject was run: {"segment good", 1}.
  std::map<std::string, int> runs() const;

 private:
  std::filesystem::path bin() const { return folder_ / "bin"; }
  std::filesystem::path log() const { return folder_ / "log"; }
  void make_stage(const PipelineStage& stage) const;
  std::filesystem::path folder_;
};

}  // namespace emmetrope::test
