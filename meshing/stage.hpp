#pragma once
#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "pipeline/base/command_line.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::meshing {

inline constexpr std::array<const char*, 5> mesh_formats{"ply", "vtp", "stl", "obj", "gii"};

struct MeshingOptions {
  std::filesystem::path case_folder;
  std::map<Laterality, EyeInstruments> instruments;
  std::map<std::string, int> vertices;  ///< by surface, "" for every one; the paper's counts elsewhere
  double edge_mm = 0;                   ///< target edge length instead of counts where > 0
  std::vector<std::string> formats;     ///< of mesh_formats; PLY is written always
  double retinal_depth_mm = usual_retinal_depth_mm;
  double scale_sd = 0.003;  ///< of the scanner's scale, a fraction: a prior that widens every length

  /// \throw Error (usage) naming the field
  void check() const;
};

/// From segmentation/<eye>/fit.json to meshing/<eye>/: five open sheets (PLY in LPS), biometry.json,
/// optics.json.
///
/// \throw Error (input_invalid) when the case has no segmentation, or a reading of another instrument cannot
///   be of its eye
Answer make_meshes(const MeshingOptions& options, const CommonOptions& common);

}  // namespace emmetrope::meshing
