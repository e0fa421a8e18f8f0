#include "segmentation/command.hpp"

#include <CLI/CLI.hpp>
#include <memory>

#include "segmentation/stage.hpp"

namespace emmetrope::segmentation {
namespace {

void declare(CLI::App& app, SegmentOptions& options) {
  app.add_option("study", options.study, "Folder of DICOM files (any depth), or NIfTI volumes")
      ->required()
      ->type_name("STUDY");
  app.add_option("-o,--output", options.case_folder, "Case folder")->required()->type_name("CASE");
  app.add_option("--series", options.series,
                 "Series to use instead of the program's choice: UID, number of inventory, or "
                 "UID,KEYWORD=VALUE; repeatable")
      ->type_name("UID");
  app.add_option("--labels", options.labels,
                 "Label volume (NIfTI) on a stack's grid, corrected by hand, to fit instead of the stack's "
                 "intensities; repeatable")
      ->allow_extra_args(false)
      ->type_name("FILE");
  app.add_option("--age", options.age_years, "Years, where the study does not say")
      ->check(CLI::Range(0.0, 120.0));
  app.add_flag("--any-modality", options.any_modality, "Also use series that do not say that they are MR");
}

}  // namespace

Command command() {
  const auto options = std::make_shared<SegmentOptions>();
  Command command;
  command.name = "segment";
  command.summary = "Finds the eyes in an MRI study and fits each to its voxels.";
  command.example = "emmetrope segment STUDY -o CASE";
  command.declare = [options](CLI::App& app) { declare(app, *options); };
  command.run = [options](const CommonOptions& common) { return segment(*options, common); };
  return command;
}

}  // namespace emmetrope::segmentation
