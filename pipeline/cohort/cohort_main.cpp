#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/workflow.hpp"

int main(int argc, char** argv) {
  emmetrope::cohort::CohortOptions options;
  return emmetrope::run_command(
      argc, argv,
      {"cohort", "Measures many studies, several at a time, and makes the table and the page of all of them.",
       "emmetrope cohort studies -o cohort",
       [&](CLI::App& app) {
         app.add_option("studies", options.studies,
                        "Folder of study folders, BIDS dataset, or a table participants.tsv")
             ->required()
             ->type_name("STUDIES");
         app.add_option("-o,--output", options.output, "Folder to make or go on with")
             ->required()
             ->type_name("OUT");
         declare(app, options.engine);
       },
       [&](const emmetrope::CommonOptions& common) {
         return emmetrope::cohort::run_cohort(options, common);
       }});
}
