#include "pipeline/base/log.hpp"

#include <spdlog/sinks/stdout_sinks.h>

namespace emmetrope {

void log_to_stderr(const std::string& command, Verbosity verbosity) {
  auto logger = std::make_shared<spdlog::logger>("emmetrope " + command,
                                                 std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("%n: %l: %v");
  logger->set_level(verbosity.quiet ? spdlog::level::warn : spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
}

}  // namespace emmetrope
