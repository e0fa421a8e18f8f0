#pragma once
#include <optional>
#include <string>
#include <string_view>

#include "pipeline/base/process.hpp"
#include "pipeline/cohort/subjects/cohort_folder.hpp"
#include "pipeline/cohort/subjects/subjects.hpp"

namespace emmetrope::cohort {

/// How a stage ended for a subject.
struct StageEnd {
  std::optional<int> status;  ///< of the command; none: it was not run, for what a stage before gave
  std::string message;        ///< why it gave no or a partial result; a line a reason
  std::string plan = {};      ///< SHA-256 of the subject's file that it followed
};
Json to_json(const StageEnd& end);
/// \throw Error (input_invalid) naming the file
StageEnd read_end(const CohortFolder& cohort, const std::string& subject, std::string_view stage);

/// Whether a stage came to its end for a subject; else what its folder holds is of an earlier run.
bool has_come_to_its_end(const CohortFolder& cohort, const std::string& subject, std::string_view stage);

/// Of the subject's file, as StageEnd has it.
std::string plan_hash(const CohortFolder& cohort, const std::string& subject);

/// Whether a command's status tells of the machine (memory, disk, device, a case in use), so that another attempt may end
/// otherwise.
bool is_of_the_machine(int status);

/// Whether a command with this status left a result, all or part of it.
bool gave_result(int status);
/// Whether it left something, be it that the data support no result.
bool came_to_its_end(int status);
/// Someone ended it, which says nothing of what it worked on.
bool was_interrupted(int status);
/// Why a command with --json gave no result.
std::string message_of_failure(const ProcessResult& ended);

struct Attempt {
  int number = 1, of = 1;
  int threads = 1;
  bool force = false;  ///< redo what is up to date
};

/// Ends that do not hold go: those of another plan, of a fault of the machine, of a result that is gone, of a refusal that
/// left the case as it was, those that cannot be read; and what came after them.
/// \return whether there were any
bool forget_ends_that_do_not_hold(const CohortFolder& cohort, const std::string& subject);

/// Runs one stage of one subject and writes its end. What the data are at fault for is an end as any other, and what the
/// stages wrote for earlier data goes, unless somebody has put files there or edited some: then all stays as it is. What
/// the machine is at fault for (no memory, a full disk, no device) is one only when it was the last attempt, and leaves
/// what is there.
/// \return 0, or the command's status where there is to be another attempt
int run_stage_of(const CohortFolder& cohort, const std::string& subject, const std::string& stage,
                 const Attempt& attempt);

}  // namespace emmetrope::cohort
