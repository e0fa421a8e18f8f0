#pragma once
#include <spdlog/spdlog.h>

#include "pipeline/base/progress.hpp"

namespace emmetrope {

/// Sets spdlog's default logger to standard error, "emmetrope NAME: warning: text". `run_command` does.
/// Use spdlog::info for notes (silent with --quiet), spdlog::warn for what the user should know.
void log_to_stderr(const std::string& command, Verbosity verbosity);

}  // namespace emmetrope
