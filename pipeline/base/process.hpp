#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace emmetrope {

/// How a child process ended and what it took.
struct ProcessResult {
  int status = 0;  ///< exit status; 128 + signal where a signal ended it
  double wall_s = 0;
  double peak_memory_MB = 0;  ///< largest resident set of the child
  std::string output;         ///< standard output, where it was captured
};

enum class ChildOutput { inherit, capture, discard };

/// Runs a program without a shell and waits for it; an interrupt of this process ends the child first.
/// \throw Error (fault) when it cannot be started, or its output not be read to the end
ProcessResult run_process(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                          ChildOutput output);

/// The program of this name on the PATH; nothing where there is none.
std::optional<std::filesystem::path> find_program(const std::string& name);

}  // namespace emmetrope
