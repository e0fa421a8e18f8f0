// Called by the workflow (Snakefile), once at its end; by hand after cases were redone.
#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/cohort/results/cohort_page.hpp"
#include "pipeline/cohort/results/cohort_rows.hpp"

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
         const std::vector<cohort::EyeRow> rows = cohort::read_rows(folder);
         write_json(output / "cohort.json", cohort::table_dictionary());
         write_file(output / "cohort.html", cohort::cohort_page(folder, rows));
         write_file(output / "cohort.tsv", cohort::table_text(rows));
         return Answer{ExitStatus::done, Json{{"eyes", rows.size()}}, {}};
       }});
}
