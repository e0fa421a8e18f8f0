#pragma once
#include <filesystem>
#include <optional>

namespace emmetrope {

/// The age of a case's subject, from its case.json; nothing where that does not say.
std::optional<double> subject_age_years(const std::filesystem::path& case_folder);

}  // namespace emmetrope
