// Called by the workflow (Snakefile), once at its end; by hand after cases were redone.
#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/cohort/results/cohort_results.hpp"

int main(int argc, char** argv) {
  using namespace emmetrope;
  std::filesystem::path output;
  return run_command(
      argc, argv,
      {"cohort-table",
       "The table and the page of a cohort, from what its cases hold; emmetrope cohort calls it.",
       "emmetrope-cohort-table cohort",
       [&](CLI::App& app) {
         app.add_option("output", output, "Folder of the cohort")->required()->type_name("OUT");
       },
       [&](const CommonOptions&) {
         const cohort::CohortFolder folder(output);
         const std::vector<cohort::EyeRow> rows = cohort::read_rows(folder, cohort::listed_subjects(folder));
         cohort::write_results(folder, rows, output);
         return Answer{ExitStatus::done, Json{{"eyes", rows.size()}}, {}};
       }});
}
