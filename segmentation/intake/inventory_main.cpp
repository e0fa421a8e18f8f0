#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "segmentation/intake/study.hpp"

int main(int argc, char** argv) {
  using namespace emmetrope;
  std::string study;
  std::vector<std::string> choices;
  segmentation::IntakeOptions options;
  Command command;
  command.name = "inventory";
  command.summary = "Lists the series of a study and what is wrong with them.";
  command.example = "emmetrope inventory STUDY --json";
  command.declare = [&](CLI::App& app) {
    app.add_option("study", study, "A folder with DICOM files or NIfTI volumes, or one such file")
        ->required();
    app.add_option("--series", choices,
                   "UID,KEYWORD=VALUE: of a series with several images at one place, those with this value");
    app.add_flag("--any-modality", options.any_modality,
                 "Also accept series that are not MR, and secondary captures");
  };
  command.run = [&](const CommonOptions& common) {
    options.verbosity = common.verbosity;
    options.choices = segmentation::parse_series_choices(choices);
    const auto inventory = segmentation::read_inventory(study, options);
    for (const auto& series : inventory.series)
      if (const std::string why = inventory.why_not_used(series); !why.empty())
        spdlog::warn("{}: not usable: {}", series.name, why);
    if (inventory.series.empty())
      spdlog::warn(
          "no DICOM images and no NIfTI volumes in {}: give the folder that the scanner's or the archive's export filled",
          study);
    return Answer{inventory.status(), segmentation::to_json(inventory), segmentation::describe(inventory)};
  };
  return run_command(argc, argv, command);
}
