#include "pipeline/report/command.hpp"

#include <CLI/CLI.hpp>
#include <memory>

#include "pipeline/base/error.hpp"
#include "pipeline/report/comparison.hpp"
#include "pipeline/report/stage.hpp"

namespace emmetrope::report {
namespace {

/// As it is typed.
struct Flags {
  ReportOptions options;
  std::vector<std::filesystem::path> compared;
};

void declare(CLI::App& app, Flags& flags) {
  ReportOptions& options = flags.options;
  auto* folder =
      app.add_option("CASE", options.case_folder, "Case folder that the stages before have filled");
  app.add_option(
      "--study", options.study,
      "DICOM study whose patient and study the DICOM objects belong to (default: where segment read it)");
  app.add_flag("--identified", options.identified, "Name and birth date from the study on the pages");
  app.add_flag(
      "--no-face", options.no_face,
      "The viewer's slices without what lies further forward than the eyes' centres, but for the eyes: a face may be known again");
  app.add_option("--compare", flags.compared,
                 "Two cases of one patient, the earlier first: a follow-up in LATER/comparison")
      ->type_name("EARLIER LATER")
      ->expected(2)
      ->excludes(folder);
}

}  // namespace

Command command() {
  const auto flags = std::make_shared<Flags>();
  Command command;
  command.name = "report";
  command.summary = "The clinical report of a case: HTML, PDF and DICOM objects in CASE/report.";
  command.example = "emmetrope report CASE";
  command.declare = [flags](CLI::App& app) { declare(app, *flags); };
  command.run = [flags](const CommonOptions& common) {
    if (!flags->compared.empty()) return write_comparison(flags->compared[0], flags->compared[1], common);
    if (flags->options.case_folder.empty())
      throw usage_error("the case folder is missing", "name it: emmetrope report CASE");
    return write_report(flags->options, common);
  };
  return command;
}

}  // namespace emmetrope::report
