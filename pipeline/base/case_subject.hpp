#pragma once
#include <filesystem>
#include <optional>
#include <string>

namespace emmetrope {

/// The age of a case's subject, from its case.json; nothing where that does not say.
std::optional<double> subject_age_years(const std::filesystem::path& case_folder);

/// By which two statements of one age may differ: a table of subjects may round otherwise than a header.
inline constexpr double rounding_of_age_years = 1;

/// That an age which was given is not the study's, which is used; empty: it is, or one of them is not known.
std::string age_warning(std::optional<double> of_study, std::optional<double> given);

}  // namespace emmetrope
