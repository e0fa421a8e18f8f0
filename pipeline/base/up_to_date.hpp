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

/// A result of which no one can say from which bytes it was made is none.
/// \param noted  SHA-256 by name, as in the key
/// \throw Error (input_invalid) naming the first input that is not what was noted
void require_unchanged(const std::vector<StageInput>& inputs, const Json& noted);

/// That a stage's folder, which is about to be replaced, holds nothing that the stage did not write: it would be lost.
/// \throw Error (input_invalid) naming the file
void require_own_folder(const std::filesystem::path& case_folder, const std::string& stage);

/// The stored outcome of a stage, if it answers the key and its outputs are still what was written; its
/// warnings are told again.
/// \throw Error (input_invalid) naming a file in the stage's folder that the stage did not write
std::optional<StageOutcome> finished(const std::filesystem::path& case_folder, const std::string& stage,
                                     const Json& key);

}  // namespace emmetrope
