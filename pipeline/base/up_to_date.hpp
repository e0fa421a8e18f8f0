#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "pipeline/base/case_folder.hpp"

/// Whether what lies in a case is still what a run would make.
namespace emmetrope {

inline constexpr const char* stage_file = "stage.json";

/// What a result depends on. The seed is part of it, threads and verbosity are not.
Json key_of(const StageSpec& spec, const CommonOptions& common);

/// The stored outcome of a stage, if it answers the key and its outputs are still what was written; its
/// warnings are told again.
std::optional<StageOutcome> finished(const std::filesystem::path& case_folder, const std::string& stage,
                                     const Json& key);

}  // namespace emmetrope
