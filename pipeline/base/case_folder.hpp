#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/base/command_line.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/stages.hpp"

namespace emmetrope {

/// Whether a folder holds a case, or what is left of one.
bool looks_like_a_case(const std::filesystem::path& folder);

/// Holds the right to write into a case: an advisory lock on CASE/.lock, inherited by the stages that a
/// driver starts.
class CaseLock {
 public:
  /// \param create  make the folder where it does not exist; it goes again if nothing is put into it
  /// \throw Error (not_writable) when another run holds it or the folder cannot be written, (input_invalid)
  ///   when it does not exist and is not to be made
  CaseLock(const std::filesystem::path& case_folder, bool create);
  ~CaseLock();
  CaseLock(const CaseLock&) = delete;
  CaseLock& operator=(const CaseLock&) = delete;

 private:
  std::filesystem::path folder_;
  int descriptor_ = -1;
  bool created_ = false;
  bool inherited_ = false;
};

/// One input of a stage: a name that does not depend on where the case lies, and the file.
struct StageInput {
  std::string name;
  std::filesystem::path path;
};

/// What a stage is about to do; two runs with the same spec and inputs' contents give the same bytes.
struct StageSpec {
  std::string stage;  ///< folder in the case: "segmentation"
  /// all that decides the result, and nothing else (no threads, no verbosity)
  Json parameters = Json::object();
  std::vector<StageInput> inputs;
  bool uses_opencl = false;  ///< the device is then part of the key
  std::string device;        ///< name and driver, when it uses OpenCL
};

/// What the stage found.
struct StageVerdict {
  ExitStatus status = ExitStatus::done;  ///< done, partial or no_result
  std::vector<std::string> reasons;      ///< why it is not done, or what to know
};

/// Where a stage writes: a folder beside the final one that takes its place when all is written.
class StageWorkspace {
 public:
  explicit StageWorkspace(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// Becomes CASE/<stage>.
  const std::filesystem::path& folder() const { return folder_; }
  /// A file at the top of the case that belongs to this stage, such as case.json: the path to write it at.
  std::filesystem::path case_file(const std::string& name);
  /// Goes to standard error now and into stage.json.
  void warn(const std::string& text);
  /// Extra provenance, merged into stage.json.
  Json& provenance() { return provenance_; }
  const std::vector<std::string>& warnings() const { return warnings_; }
  const std::vector<std::string>& case_files() const { return case_files_; }

 private:
  std::filesystem::path folder_;
  std::vector<std::string> warnings_;
  std::vector<std::string> case_files_;
  Json provenance_ = Json::object();
};

struct StageOutcome {
  StageVerdict verdict;
  bool skipped = false;  ///< all was up to date
  double wall_s = 0;
  Json stage_json;
};

/// Runs `work` unless CASE/<stage>/stage.json shows, by SHA-256 of inputs and outputs, that its result is
/// there already. The result and its stage.json (program version, command line, parameters, seed, SHA-256 of
/// every input and output, OpenCL device, wall seconds, warnings, verdict) appear together or not at all.
/// `work` returns done, partial or no_result; when it throws, the case stays as it was.
/// \throw Error (input_invalid) when an input changed meanwhile; unless forced, when somebody put a file among its results
StageOutcome run_stage(const std::filesystem::path& case_folder, const StageSpec& spec,
                       const CommonOptions& common, const std::function<StageVerdict(StageWorkspace&)>& work);

/// The verdict of a finished stage whose outputs are still what it wrote, and whose inputs in the case are
/// still those that it was made from; the same holds for the stages before it.
/// \throw Error (input_invalid) when CASE/<stage>/stage.json is missing or broken, when a file was edited,
///   removed or added since (hidden ones are not read), or when a stage before it has been made anew (mixed
///   results would be of no eye), naming the command that makes it again
StageVerdict read_verdict(const std::filesystem::path& case_folder, const std::string& stage);

/// Whether a stage's result is there, all of it as the stage wrote it, and nothing that it did not write beside it.
bool is_as_written(const std::filesystem::path& case_folder, const std::string& stage);

/// Removes what a stage wrote; what somebody has put there or edited since stays.
/// \throw Error (not_writable)
void remove_result(const std::filesystem::path& case_folder, const std::string& stage);

/// All regular files below a folder of the case, sorted, named relative to the case: the inputs a stage
/// declares.
std::vector<StageInput> inputs_below(const std::filesystem::path& case_folder, const std::string& subfolder);

/// "meshing: done in 3.1 s" or "meshing: up to date, skipped" as a line of a stage's text answer; nothing
/// when quiet.
std::string describe(const std::string& stage, const StageOutcome& outcome, Verbosity verbosity);

}  // namespace emmetrope
