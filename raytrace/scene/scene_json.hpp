#pragma once
#include <filesystem>

#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// Reads a scene.json (docs/use/scene-json.md); pictures are looked for relative to the file.
/// \throw Error (input_invalid) naming file and key
Scene read_scene(const std::filesystem::path& file);

}  // namespace emmetrope::raytrace
