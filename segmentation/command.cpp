#include "segmentation/command.hpp"

#include <CLI/CLI.hpp>
#include <memory>

#include "pipeline/eye/population/limits.hpp"
#include "segmentation/stage.hpp"

namespace emmetrope::segmentation {
namespace {

/// What was typed.
struct Typed {
  SegmentOptions options;
  std::vector<std::string> series;
};

void declare(CLI::App& app, Typed& typed) {
  SegmentOptions& options = typed.options;
  app.add_option("study", options.study, "Folder of DICOM files (any depth), or NIfTI volumes")
      ->required()
      ->type_name("STUDY");
  app.add_option("-o,--output", options.case_folder, "Case folder")->required()->type_name("CASE");
  app.add_option("--series", typed.series,
                 "Series to use instead of the program's choice: UID, number of inventory, or "
                 "UID,KEYWORD=VALUE; repeatable")
      ->type_name("UID");
  app.add_option("--labels", options.labels,
                 "Label volume (NIfTI) on a stack's grid, corrected by hand, to fit instead of the stack's "
                 "intensities; repeatable")
      ->allow_extra_args(false)
      ->type_name("FILE");
  app.add_option("--age", options.age_years, "Years, where the study does not say")
      ->check(CLI::Range(human_age_years.low, human_age_years.high));
  app.add_flag("--any-modality", options.any_modality, "Also use series that do not say that they are MR");
}

}  // namespace

Command command() {
  const auto typed = std::make_shared<Typed>();
  Command command;
  command.name = "segment";
  command.summary = "Finds the eyes in an MRI study and fits each to its voxels.";
  command.example = "emmetrope segment STUDY -o CASE";
  command.declare = [typed](CLI::App& app) { declare(app, *typed); };
  command.run = [typed](const CommonOptions& common) {
    typed->options.series = parse_series_choices(typed->series);
    return segment(typed->options, common);
  };
  return command;
}

}  // namespace emmetrope::segmentation
