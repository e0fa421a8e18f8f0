#include "tests/support/stand_in_stages.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "pipeline/base/files.hpp"

namespace emmetrope::test {
namespace fs = std::filesystem;

StandInStages::StandInStages(fs::path folder) : folder_(std::move(folder)) {
  const fs::path built = std::getenv("EMMETROPE_BIN");
  fs::create_directories(bin());
  for (const char* name :
       {"emmetrope-cohort", "emmetrope-cohort-stage", "emmetrope-cohort-table", "emmetrope-bids"})
    fs::copy_file(built / name, bin() / name);
  const fs::path share = folder_ / "share" / "emmetrope" / "pipeline" / "cohort";
  fs::create_directories(share / "engine");
  const fs::path workflow = data_folder() / "pipeline" / "cohort";
  fs::copy_file(workflow / "Snakefile", share / "Snakefile");
  fs::copy(workflow / "engine" / "slurm", share / "engine" / "slurm");
  for (const PipelineStage& stage : pipeline_stages) make_stage(stage);
}

ProcessResult StandInStages::run(const std::string& command, const std::vector<std::string>& words) const {
  return run_process(program(command), words, ChildOutput::capture);
}

void StandInStages::tell(const std::string& subject, const std::string& stage,
                         const std::string& status) const {
  fs::create_directories(folder_ / "told" / subject);
  write_file(folder_ / "told" / subject / stage, status);
}

void StandInStages::forget(const std::string& subject, const std::string& stage) const {
  fs::remove(folder_ / "told" / subject / stage);
}

void StandInStages::slow(bool is_slow) const {
  if (is_slow)
    write_file(folder_ / "slow", "");
  else
    fs::remove(folder_ / "slow");
}

std::map<std::string, int> StandInStages::runs() const {
  std::map<std::string, int> counts;
  if (!fs::exists(log())) return counts;
  std::istringstream lines(read_file(log()));
  for (std::string line; std::getline(lines, line);) ++counts[line];
  return counts;
}

void StandInStages::make_stage(const PipelineStage& stage) const {
  const fs::path script = program(stage.command);
  std::ofstream(script)
      << "#!/bin/sh\n"
      << "case=$1; [ " << stage.command << " != segment ] || case=$3\n"
      << "name=$(basename \"$case\"); told='" << folder_.string() << "/told'/$name\n"
      << "echo \"" << stage.command << " $name\" >>'" << log().string() << "'\n"
      << "[ ! -e '" << folder_.string() << "/slow' ] || sleep 1\n"
      << "status=0; [ ! -e \"$told/" << stage.command << "\" ] || status=$(cat \"$told/" << stage.command
      << "\")\n"
      << "once=\"$told/" << stage.command << ".once\"\n"
      << "[ ! -e \"$once\" ] || { status=$(cat \"$once\"); mv \"$once\" '" << folder_.string()
      << "/used'; }\n"
      << "[ \"$status\" != kill ] || { kill -9 $PPID; exit 1; }\n"
      << "case $status in 0|6|8) mkdir -p \"$case/" << stage.folder << "\"\n"
      << "echo '{\"verdict\": {\"status\": '$status', \"reasons\": [\"why\"]}, \"inputs\": {}}' >\"$case/"
      << stage.folder << "/stage.json\";; esac\n"
      << "echo '{\"error\": {\"message\": \"told by " << stage.command << "\"}}'\nexit $status\n";
  fs::permissions(script, fs::perms::owner_all);
}

}  // namespace emmetrope::test
