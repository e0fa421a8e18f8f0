#include "pipeline/driver/run_options.hpp"

namespace emmetrope::driver {
namespace {

/// An option that belongs to a stage: checked there, handed on as it was typed.
struct Passed {
  const char* flag;
  const char* help;
  std::vector<std::string> RunOptions::*stage;
};

const std::vector<Passed>& passed() {
  static const std::vector<Passed> options{
      {"--series", "DICOM series (UID or number of inventory) to use; repeatable",
       &RunOptions::segment_options},
      {"--keratometry", "EYE:K1@AXIS/K2@AXIS[+-SD] in dioptres, od:43.25@175/44.75@85+-0.25",
       &RunOptions::mesh_options},
      {"--axial-length", "EYE:MM[+-SD], optical, od:23.60+-0.05", &RunOptions::mesh_options},
      {"--acd", "EYE:MM[+-SD], apex to lens front", &RunOptions::mesh_options},
      {"--lens-thickness", "EYE:MM[+-SD]", &RunOptions::mesh_options},
      {"--age", "Years, where the study does not say", &RunOptions::trace_options},
      {"--lens-index", "Equivalent index of the lens, instead of the one for the age",
       &RunOptions::trace_options},
      {"--vertex-distance", "Spectacle to cornea, mm", &RunOptions::correct_options},
  };
  return options;
}

}  // namespace

void declare(CLI::App& app, RunOptions& options) {
  app.add_option("study", options.study, "Folder of MR images (DICOM, or NIfTI volumes)")
      ->required()
      ->type_name("STUDY");
  app.add_option("-o", options.case_folder, "Case folder to make or go on with")
      ->required()
      ->type_name("CASE");
  app.add_flag_callback(
      "--identified", [&options] { options.report_options.emplace_back("--identified"); },
      "Name and birth date on the report's pages");
  for (const Passed& option : passed())
    app.add_option_function<std::vector<std::string>>(
           option.flag,
           [&options, option](const std::vector<std::string>& values) {
             for (const auto& value : values)
               (options.*option.stage).insert((options.*option.stage).end(), {option.flag, value});
           },
           option.help)
        ->allow_extra_args(false)
        ->type_name("VALUE");
}

}  // namespace emmetrope::driver
