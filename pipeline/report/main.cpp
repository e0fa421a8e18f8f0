#include "pipeline/report/report.hpp"

int main(int argc, char** argv) {
  using namespace emmetrope;
  report::ReportOptions options;
  Command command;
  command.name = "report";
  command.summary = "The clinical report of a case: HTML, PDF and DICOM objects in CASE/report.";
  command.example = "emmetrope report CASE";
  command.declare = [&](CLI::App& app) {
    app.add_option("CASE", options.case_folder, "Case folder that the stages before have filled")->required();
    app.add_option("--study", options.study,
                   "DICOM study of the case, whose patient and study the DICOM objects belong to (default: where "
                   "segment found it)");
    app.add_flag("--identified", options.identified, "Name and birth date from the study on the pages");
  };
  command.run = [&](const CommonOptions& common) { return report::write_report(options, common); };
  return run_command(argc, argv, command);
}
