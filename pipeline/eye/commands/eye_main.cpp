#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "pipeline/base/command_line.hpp"
#include "pipeline/eye/commands/describe_eye.hpp"

using namespace emmetrope;

int main(int argc, char** argv) {
  EyeQuery query;
  Command command;
  command.name = "eye";
  command.summary = "Cardinal points, pupils and refraction of a schematic eye or of an eye.json";
  command.example = "emmetrope eye navarro --accommodation 4 --json";
  command.declare = [&](CLI::App& app) {
    app.add_option("eye", query.eye,
                   "Schematic eye, eye.json, or lens of Zemax (.zmx), Optiland or visisipy (.json): " +
                       schematic_eyes_line())
        ->required()
        ->type_name("NAME|FILE");
    declare_eye_options(app, query.options);
    app.add_option("--wavelength", query.wavelength_nm,
                   "Wavelength (nm); default: the eye's reference wavelength")
        ->check(CLI::Range(200.0, 2500.0))
        ->type_name("NM");
    app.add_option("-o,--output", query.output, "Write the eye as eye.json, or as a lens of Zemax (.zmx)")
        ->type_name("FILE");
  };
  command.result_keys = {"name",
                         "wavelength_nm",
                         "power_D",
                         "object_focal_mm",
                         "image_focal_mm",
                         "object_principal_mm",
                         "image_principal_mm",
                         "object_nodal_mm",
                         "image_nodal_mm",
                         "entrance_pupil",
                         "exit_pupil",
                         "axial_length_mm",
                         "refraction",
                         "refraction_D"};
  command.run = [&](const CommonOptions& common) {
    if (common.laterality == LateralityChoice::os) query.options.laterality = Laterality::os;
    return describe_eye(query);
  };
  return run_command(argc, argv, command);
}
