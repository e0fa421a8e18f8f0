#include "meshing/command.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <memory>

#include "meshing/stage.hpp"

namespace emmetrope::meshing {
namespace {

/// As it is typed.
struct Flags {
  MeshingOptions options;
  InstrumentFlags instruments;
  std::vector<std::string> vertices;  ///< "1500" for every surface, "retina:973" for one
};

/// \throw Error (usage) naming what cannot be read
std::map<std::string, int> parse_vertices(const std::vector<std::string>& texts) {
  std::map<std::string, int> counts;
  for (const std::string& text : texts) {
    const auto colon = text.find(':');
    const std::string name = colon == std::string::npos ? "" : text.substr(0, colon);
    const std::string digits = colon == std::string::npos ? text : text.substr(colon + 1);
    if (digits.empty() || digits.size() > 7 || digits.find_first_not_of("0123456789") != std::string::npos)
      throw usage_error("--vertices " + text + ": cannot be read",
                        "expected N or SURFACE:N, such as retina:973");
    counts[name] = std::stoi(digits);
  }
  return counts;
}

void declare(CLI::App& app, Flags& flags) {
  MeshingOptions& options = flags.options;
  app.add_option("case", options.case_folder, "Case folder with a finished segmentation")
      ->required()
      ->type_name("CASE");
  emmetrope::declare(app, flags.instruments);
  app.add_option("--vertices", flags.vertices,
                 "Vertices of every surface, or SURFACE:N; default: the published counts")
      ->allow_extra_args(false)
      ->type_name("[SURFACE:]N");
  app.add_option("--edge-mm", options.edge_mm, "Target edge length in mm instead of vertex counts")
      ->check(CLI::Range(0.05, 2.0))
      ->excludes("--vertices");
  app.add_option("--format", options.formats, "Further mesh formats besides PLY: vtp, stl, obj, gii")
      ->allow_extra_args(false)
      ->check(CLI::IsMember(std::vector<std::string>(mesh_formats.begin(), mesh_formats.end())));
  app.add_option(
         "--scale-sd", options.scale_sd,
         "Standard deviation of the scanner's scale as a fraction, such as 0.003 for uncorrected gradients")
      ->check(CLI::Range(0.0, 0.05))
      ->capture_default_str();
  app.add_option("--retinal-depth", options.retinal_depth_mm,
                 "Photoreceptors behind the vitreo-retinal interface, mm")
      ->check(CLI::Range(0.0, most_retinal_depth_mm))
      ->capture_default_str();
}

MeshingOptions read_flags(const Flags& flags) {
  MeshingOptions options = flags.options;
  options.vertices = parse_vertices(flags.vertices);
  options.instruments = parse_instruments(flags.instruments, options.retinal_depth_mm);
  return options;
}

void check_readable(const MeshingOptions& options) {
  options.check();
  for (const auto& [eye, given] : options.instruments) read_instruments(given);
}

}  // namespace

Command command() {
  const auto flags = std::make_shared<Flags>();
  Command command;
  command.name = "mesh";
  command.summary = "Makes surface meshes and biometry of each eye from its segmentation.";
  command.example =
      "emmetrope mesh CASE --keratometry od:43.25@175/44.75@85+-0.25 --axial-length od:23.60+-0.05";
  command.declare = [flags](CLI::App& app) { declare(app, *flags); };
  command.run = [flags](const CommonOptions& common) { return make_meshes(read_flags(*flags), common); };
  command.check = [flags](const CommonOptions& /*common*/) { check_readable(read_flags(*flags)); };
  return command;
}

}  // namespace emmetrope::meshing
