#include "meshing/stage.hpp"

int main(int argc, char** argv) {
  emmetrope::MeshingOptions options;
  emmetrope::Command command;
  command.name = "mesh";
  command.summary = "Makes surface meshes and biometry of each eye from its segmentation.";
  command.example =
      "emmetrope mesh CASE --keratometry od:43.25@175/44.75@85+-0.25 --axial-length od:23.60+-0.05";
  command.declare = [&](CLI::App& app) {
    app.add_option("case", options.case_folder, "Case folder with a finished segmentation")
        ->required()
        ->type_name("CASE");
    declare(app, options.instruments);
    app.add_option("--vertices", options.vertices,
                   "Vertices of every surface, or SURFACE:N; default: the published counts")
        ->allow_extra_args(false)
        ->type_name("[SURFACE:]N");
    app.add_option("--edge-mm", options.edge_mm, "Target edge length in mm instead of vertex counts")
        ->check(CLI::Range(0.05, 2.0))
        ->excludes("--vertices");
    app.add_option("--format", options.formats, "Further mesh formats besides PLY: vtp, stl, obj, gii")
        ->allow_extra_args(false)
        ->check(CLI::IsMember({"ply", "vtp", "stl", "obj", "gii"}));
    app.add_option(
           "--scale-sd", options.scale_sd,
           "Standard deviation of the scanner's scale as a fraction, such as 0.003 for uncorrected gradients")
        ->check(CLI::Range(0.0, 0.05))
        ->capture_default_str();
    app.add_option("--retinal-depth", options.retinal_depth_mm,
                   "Photoreceptors behind the vitreo-retinal interface, mm")
        ->check(CLI::Range(0.0, 1.0))
        ->capture_default_str();
  };
  command.run = [&](const emmetrope::CommonOptions& common) {
    return emmetrope::make_meshes(options, common);
  };
  return emmetrope::run_command(argc, argv, command);
}
