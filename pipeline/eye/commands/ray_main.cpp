#include <CLI/CLI.hpp>
#include "pipeline/base/command_line.hpp"
#include "pipeline/eye/commands/describe_eye.hpp"

using namespace emmetrope;

int main(int argc, char** argv) {
  RayQuery query;
  Command command;
  command.name = "ray";
  command.summary =
      "One exact ray through an eye, in float64 (eye frame: mm, +z out of the eye, origin at the corneal "
      "apex)";
  command.example = "emmetrope ray --eye navarro --from 0,2,20 --to 0,2,0 --json";
  command.declare = [&](CLI::App& app) {
    app.add_option("--eye", query.eye, "Schematic eye or eye.json: " + schematic_eyes_line())
        ->required()
        ->type_name("NAME|FILE");
    declare_eye_options(app, query.options);
    app.add_option("--from", query.from_mm,
                   "Where the ray starts (mm), in front of the cornea or on the retina")
        ->required()
        ->delimiter(',')
        ->expected(3)
        ->type_name("X,Y,Z");
    app.add_option("--to", query.to_mm, "A second point on the incoming line (mm)")
        ->required()
        ->delimiter(',')
        ->expected(3)
        ->type_name("X,Y,Z");
    app.add_option("--wavelength", query.wavelength_nm,
                   "Wavelength (nm); default: the eye's reference wavelength")
        ->check(CLI::Range(200.0, 2500.0))
        ->type_name("NM");
  };
  command.run = [&](const CommonOptions& common) {
    if (common.laterality == LateralityChoice::os) query.options.laterality = Laterality::os;
    return describe_ray(query);
  };
  return run_command(argc, argv, command);
}
