#include "pipeline/driver/run_options.hpp"

#include <CLI/CLI.hpp>
namespace emmetrope::driver {
namespace {

/// An option that belongs to one or more stages: checked there, handed on as it was typed.
struct Passed {
  const char* flag;
  const char* help;
  std::vector<std::vector<std::string> RunOptions::*> stages;
};

const std::vector<Passed>& passed() {
  using Run = RunOptions;
  static const std::vector<Passed> options{
      {"--series", "Series to use: UID or number of inventory; repeatable", {&Run::segment_options}},
      {"--labels", "Label volume corrected by hand; repeatable", {&Run::segment_options}},
      {"--keratometry", "od:43.25@175/44.75@85+-0.25 (D, degrees)", {&Run::mesh_options}},
      {"--axial-length", "od:23.60+-0.05 (optical, mm)", {&Run::mesh_options}},
      {"--acd", "od:3.4+-0.1 (apex to lens front, mm)", {&Run::mesh_options}},
      {"--lens-thickness", "od:3.8+-0.1 (mm)", {&Run::mesh_options}},
      {"--topography", "od:FILE of corneal elevation", {&Run::mesh_options}},
      {"--scale-sd", "Relative scale error of the scanner (1 SD)", {&Run::mesh_options}},
      {"--retinal-depth",
       "Photoreceptors behind the interface, mm",
       {&Run::mesh_options, &Run::trace_options}},
      {"--scene", "Chart of the pictures, letters:logmar=0.3", {&Run::trace_options}},
      {"--fovea", "X,Y on the retina from the pole, mm; one eye", {&Run::trace_options}},
      {"--age",
       "Years, where the study does not say",
       {&Run::segment_options, &Run::trace_options, &Run::correct_options}},
      {"--lens-index", "Equivalent index of the lens", {&Run::trace_options}},
      {"--lens-model", "homogeneous or core", {&Run::trace_options}},
      {"--refraction", "Known: od:-2.25/-1.00x180@12+-0.25", {&Run::correct_options}},
      {"--vertex-distance", "Spectacle to cornea, mm", {&Run::correct_options}},
  };
  return options;
}

}  // namespace

void declare(CLI::App& app, RunOptions& options) {
  app.add_option("study", options.study, "Folder of MR images (DICOM, or NIfTI volumes)")
      ->required()
      ->type_name("STUDY");
  app.add_option("-o,--output", options.case_folder, "Case folder to make or go on with")
      ->required()
      ->type_name("CASE");
  app.add_flag_callback(
      "--no-face", [&options] { options.report_options.emplace_back("--no-face"); },
      "the report's viewer without what lies further forward than the eyes' centres, but for the eyes");
  app.add_flag_callback(
      "--identified", [&options] { options.report_options.emplace_back("--identified"); },
      "Name and birth date on the report's pages");
  app.add_flag_callback(
      "--any-modality", [&options] { options.segment_options.emplace_back("--any-modality"); },
      "Also use series that do not say that they are MR");
  for (const Passed& option : passed())
    app.add_option_function<std::vector<std::string>>(
           option.flag,
           [&options, option](const std::vector<std::string>& values) {
             for (const auto stage : option.stages)
               for (const auto& value : values)
                 (options.*stage).insert((options.*stage).end(), {option.flag, value});
           },
           option.help)
        ->allow_extra_args(false)
        ->type_name("VALUE");
}

}  // namespace emmetrope::driver
