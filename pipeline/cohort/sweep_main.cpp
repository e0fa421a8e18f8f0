#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/sweep/sweep.hpp"

int main(int argc, char** argv) {
  emmetrope::cohort::SweepOptions options;
  return emmetrope::run_command(
      argc, argv,
      {"sweep",
       "Runs trace, correct or eye with every combination of settings, and makes one table of the results.",
       "emmetrope sweep pupils.toml -o pupils",
       [&](CLI::App& app) {
         app.add_option("table", options.table, "TOML file: command, [all], [vary], [columns]")
             ->required()
             ->type_name("TABLE");
         app.add_option("-o,--output", options.output, "Folder to make or go on with")
             ->required()
             ->type_name("OUT");
         declare(app, options.engine);
       },
       [&](const emmetrope::CommonOptions& common) {
         return emmetrope::cohort::run_sweep(options, common);
       }});
}
