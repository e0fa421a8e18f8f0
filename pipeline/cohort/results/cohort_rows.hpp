#pragma once
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/cohort/subjects/cohort_folder.hpp"

namespace emmetrope::cohort {

/// What came of an eye.
enum class Outcome {
  measured,   ///< with a refraction
  partial,    ///< some of the numbers
  no_result,  ///< the images do not support any
  failed      ///< the study could not be read, or the machine failed
};
const char* to_string(Outcome outcome);

/// One eye of one subject, from what the stages left; the images are not looked at.
struct EyeRow {
  std::string subject;
  Laterality eye = Laterality::od;
  Outcome outcome = Outcome::failed;
  std::string stage;                     ///< the command that gave less than all; empty for none
  std::string reason;                    ///< in one line; without a stage a caution
  std::optional<double> age_years;       ///< as the images say, else as the table of participants does
  std::optional<double> told_age_years;  ///< as the table does
  std::string sex;              ///< as the images say, else (and where theirs is "O") as the table does
  std::string told_sex;         ///< as the table does
  std::string study;            ///< pseudonym of the study; empty where there is no case
  std::set<std::string> scans;  ///< of the subject, as used_scans()
  std::map<std::string, Measured> numbers;  ///< by column of quantities(); what is withheld is not there
};

/// The subjects of subjects.txt.
std::vector<std::string> listed_subjects(const CohortFolder& cohort);
/// Whether every stage of a subject has ended, by its plan.
bool is_finished(const CohortFolder& cohort, const std::string& subject);
/// A row for each eye that was asked for. A case that is not as the stages left it, one made from another than lies beside
/// it, or a file that is broken is a failure of its subject.
std::vector<EyeRow> read_rows(const CohortFolder& cohort, const std::vector<std::string>& subjects);

/// The right and the left eye of each subject with a row of both.
std::vector<std::pair<const EyeRow*, const EyeRow*>> fellow_eyes(const std::vector<EyeRow>& rows);

/// Eyes of different subjects that were measured from images with the same voxels, or have the same numbers to the last
/// digit, one scan under two names: a sentence a pair.
std::vector<std::string> scans_named_twice(const std::vector<EyeRow>& rows);

/// Subjects whose images tell another sex than the table of participants: a sentence each.
std::vector<std::string> sexes_that_differ(const std::vector<EyeRow>& rows);

/// Subjects whose images tell another age than the table of participants.
std::vector<std::string> ages_that_differ(const std::vector<EyeRow>& rows);

/// Subjects with images of one study: its series, each taken for a study.
std::vector<std::string> studies_named_twice(const std::vector<EyeRow>& rows);

/// The sentences of all.
std::vector<std::string> doubts_about(const std::vector<EyeRow>& rows);

struct Outcomes {
  std::size_t measured = 0, partial = 0, no_result = 0, failed = 0;
};
Outcomes count_outcomes(const std::vector<EyeRow>& rows);

/// Tab-separated, "n/a" where there is nothing, as BIDS has tables.
std::string table_text(const std::vector<EyeRow>& rows);
/// What its columns are, as BIDS describes them: {"axial_length": {"Description", "Units"}, ...}.
Json table_dictionary();

}  // namespace emmetrope::cohort
