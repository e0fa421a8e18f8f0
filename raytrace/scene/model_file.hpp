#pragma once
#include <filesystem>
#include <vector>

#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

/// Reads a model: OBJ (with its MTL), PLY, STL, glTF or GLB; one object a material, in the file's own units
/// and frame. Missing normals are made, smooth across edges of less than 60 degrees. Pictures become
/// textures.
/// \param files  where given, what was read is added: the model, its materials and pictures.
/// \throw Error (input_invalid) naming the file and what is wrong, (unsupported) for other endings
std::vector<MeshObject> read_model(const std::filesystem::path& file,
                                   std::vector<std::filesystem::path>* files = nullptr);

}  // namespace emmetrope::raytrace
