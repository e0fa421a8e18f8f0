#include "pipeline/base/error.hpp"
#include "pipeline/report/content/comparison.hpp"
#include "pipeline/report/stage.hpp"

int main(int argc, char** argv) {
  using namespace emmetrope;
  report::ReportOptions options;
  std::vector<std::filesystem::path> compared;
  Command command;
  command.name = "report";
  command.summary = "The clinical report of a case: HTML, PDF and DICOM objects in CASE/report.";
  command.example = "emmetrope report CASE";
  command.declare = [&](CLI::App& app) {
    auto* folder =
        app.add_option("CASE", options.case_folder, "Case folder that the stages before have filled");
    app.add_option(
        "--study", options.study,
        "DICOM study whose patient and study the DICOM objects belong to (default: where segment read it)");
    app.add_flag("--identified", options.identified, "Name and birth date from the study on the pages");
    app.add_option("--compare", compared,
                   "Two cases of one patient, the earlier first: a follow-up in LATER/comparison")
        ->type_name("EARLIER LATER")
        ->expected(2)
        ->excludes(folder);
  };
  command.run = [&](const CommonOptions& common) {
    if (!compared.empty()) return report::write_comparison(compared[0], compared[1], common);
    if (options.case_folder.empty())
      throw usage_error("the case folder is missing", "name it: emmetrope report CASE");
    return report::write_report(options, common);
  };
  return run_command(argc, argv, command);
}
