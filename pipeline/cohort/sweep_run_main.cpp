// Called by the workflow (sweep/Snakefile), once a run.
#include <signal.h>
#include <sys/prctl.h>

#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/sweep/sweep_run.hpp"

int main(int argc, char** argv) {
  using namespace emmetrope;
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);  // it does not outlive an engine that was killed
  std::filesystem::path output;
  std::string run;
  cohort::Attempt attempt;
  return run_command(
      argc, argv,
      {"sweep-run", "One run of a parameter study; emmetrope sweep calls it.",
       "emmetrope-sweep-run pupils 0123456789ab",
       [&](CLI::App& app) {
         app.add_option("output", output, "Folder of the sweep")->required()->type_name("OUT");
         app.add_option("run", run, "One of its runs")->required()->type_name("RUN");
         app.add_option("--attempt", attempt.number, "This is the Nth attempt")->type_name("N");
         app.add_option("--attempts", attempt.of, "There are no more than N")->type_name("N");
       },
       [&](const CommonOptions& common) {
         attempt.threads = common.thread_count();
         const cohort::SweepFolder folder{std::filesystem::absolute(output).lexically_normal()};
         const int status = run_of_sweep(folder, run, attempt);
         return Answer{static_cast<ExitStatus>(status), Json{{"status", status}}, {}};
       }});
}
