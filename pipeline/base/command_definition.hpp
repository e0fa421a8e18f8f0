#pragma once
#include "pipeline/base/command_line.hpp"
#include "pipeline/base/json.hpp"

namespace emmetrope {

/// What a command takes, for manual pages and shells that complete its words: {"name", "summary", "example", "options":
/// [{"names": ["-o", "--output"], "value": "OUT" (empty: a flag), "choices": [], "description", "is_required",
/// "is_positional", "takes_many", "is_common"}], "result_keys": []}, options in the order of --help.
Json command_definition(const CLI::App& app, const Command& command);

}  // namespace emmetrope
