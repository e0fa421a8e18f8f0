#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/base/laterality.hpp"
#include "pipeline/base/progress.hpp"

namespace CLI {
class App;
}

namespace emmetrope {

/// Options that every command has.
struct CommonOptions {
  bool json = false;   ///< the answer as one JSON document on standard output
  bool force = false;  ///< redo what is up to date
  Verbosity verbosity;
  std::string device;  ///< OpenCL device by index or part of its name; empty: the first
  int threads = 0;     ///< 0: all cores
  std::uint64_t seed = 1;
  LateralityChoice laterality = LateralityChoice::both;
  std::string command_line;  ///< as it was typed, for provenance

  /// threads, or the number of cores where it is 0
  int thread_count() const;
};

/// What a command has to say: a status, and the same answer for people and for programs.
struct Answer {
  ExitStatus status = ExitStatus::done;
  Json json = Json::object();
  std::string text;  ///< for standard output without --json; may be empty
};

/// One executable: declared options and one library call.
struct Command {
  std::string name;     ///< "segment"
  std::string summary;  ///< one sentence for --help
  std::string example;  ///< one line for --help
  std::function<void(CLI::App&)> declare;
  std::function<Answer(const CommonOptions&)> run;
  /// Throws what `run` would refuse of the options before it looks into a case, beyond what their declarations check.
  std::function<void(const CommonOptions&)> check = {};
  /// Of the JSON of one eye that it answers or writes, for who asks for parts of it before it runs.
  std::vector<std::string> result_keys = {};
};

/// Parses, runs (with the hidden flag --check-options: only checks the options, for who is to run it later), prints the
/// answer on standard output and everything else on standard error; turns exceptions into a message and an exit status.
/// To be returned from main.
int run_command(int argc, char** argv, const Command& command);

}  // namespace emmetrope
