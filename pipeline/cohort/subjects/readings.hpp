#pragma once
#include <string>
#include <vector>

#include "pipeline/cohort/subjects/subjects.hpp"
#include "pipeline/cohort/subjects/table.hpp"

/// What tables of participants say: ages, and what was measured of the eyes elsewhere.
namespace emmetrope::cohort {

inline constexpr const char* id_column = "participant_id";

/// A name that is one of a folder everywhere.
std::string plain_name(std::string name);

/// \throw Error (input_invalid) where a row names nobody, or somebody who has a row already
void require_distinct_rows(const Table& table, bool bids);

/// Puts ages and sexes into the subjects, and readings into their options, as find_subjects() says.
/// \param all_are_here  every person with a study is among the subjects, so that a row without one is a mistake
/// \throw Error (input_invalid) naming line and column
void add_readings(std::vector<Subject>& subjects, const Table& table, bool bids, bool all_are_here);

/// Puts what sub-X/sub-X_sessions.tsv says of a session's age in the place of the person's.
/// \throw Error (input_invalid) naming line and column
void add_ages_of_sessions(std::vector<Subject>& subjects, const std::filesystem::path& dataset);
/// So that the stages know them.
void add_ages_to_options(std::vector<Subject>& subjects);

/// Sentences on subjects of a BIDS dataset who have no row in its table of participants, or another age or sex.
std::vector<std::string> contradictions(const std::vector<Subject>& subjects, const Table& table);

}  // namespace emmetrope::cohort
