#pragma once
#include <filesystem>
#include <string>

namespace emmetrope::driver {

/// What a stage that gave no result leaves behind from an earlier run would contradict the new report.
/// \throw Error (not_writable) where it cannot be removed
void remove_stale_results(const std::filesystem::path& case_folder, const std::string& stage_folder);

}  // namespace emmetrope::driver
