#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/base/command_line.hpp"
#include "pipeline/eye/instruments/instruments.hpp"

namespace emmetrope::meshing {

/// What `emmetrope mesh` was asked for.
struct MeshingOptions {
  std::filesystem::path case_folder;
  InstrumentFlags instruments;
  std::vector<std::string>
      vertices;        ///< "1500" for every surface, "retina:973" for one; the paper's counts elsewhere
  double edge_mm = 0;  ///< target edge length instead of counts where > 0
  std::vector<std::string> formats;  ///< besides PLY: "vtp", "stl", "obj", "gii"
  double retinal_depth_mm = 0.20;
  double scale_sd = 0.003;  ///< of the scanner's scale, a fraction: a prior that widens every length
};

/// From segmentation/<eye>/fit.json to meshing/<eye>/: five open sheets (PLY in LPS), biometry.json,
/// optics.json.
///
/// \throw Error (input_invalid) when the case has no segmentation, (usage) for an option that
/// cannot be read
Answer make_meshes(const MeshingOptions& options, const CommonOptions& common);

}  // namespace emmetrope::meshing
