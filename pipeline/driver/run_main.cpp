#include "pipeline/base/command_line.hpp"
#include "pipeline/driver/run.hpp"
#include "pipeline/driver/run_options.hpp"

int main(int argc, char** argv) {
  emmetrope::driver::RunOptions options;
  return emmetrope::run_command(
      argc, argv,
      {"run",
       "From a folder of MR images to the report: segment, mesh, trace, correct, report. Redoes only what is "
       "stale.",
       "emmetrope run study -o case", [&](CLI::App& app) { emmetrope::driver::declare(app, options); },
       [&](const emmetrope::CommonOptions& common) {
         return emmetrope::driver::run_pipeline(options, common);
       }});
}
