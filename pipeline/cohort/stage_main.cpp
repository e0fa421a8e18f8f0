// Called by the workflow (Snakefile), once a stage of a subject.
#include <signal.h>
#include <sys/prctl.h>

#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/subjects/stage_end.hpp"

int main(int argc, char** argv) {
  using namespace emmetrope;
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);  // it does not outlive an engine that was killed
  std::filesystem::path output;
  std::string subject, stage;
  cohort::Attempt attempt;
  return run_command(
      argc, argv,
      {"cohort-stage", "One stage of one subject of a cohort; emmetrope cohort calls it.",
       "emmetrope-cohort-stage cohort sub-01 segment",
       [&](CLI::App& app) {
         app.add_option("output", output, "Folder of the cohort")->required()->type_name("OUT");
         app.add_option("subject", subject, "One of its subjects")->required()->type_name("SUBJECT");
         app.add_option("stage", stage, "segment, mesh, trace, correct or report")
             ->required()
             ->type_name("STAGE");
         app.add_option("--attempt", attempt.number, "This is the Nth attempt")->type_name("N");
         app.add_option("--attempts", attempt.of, "There are no more than N")->type_name("N");
       },
       [&](const CommonOptions& common) {
         attempt.threads = common.thread_count();
         attempt.force = common.force;
         const int status = run_stage_of(cohort::CohortFolder(output), subject, stage, attempt);
         return Answer{static_cast<ExitStatus>(status), Json{{"status", status}}, {}};
       }});
}
