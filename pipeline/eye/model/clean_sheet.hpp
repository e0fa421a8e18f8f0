#pragma once
#include <string>
#include <vector>

#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope {

/// What other programs write, as an optical surface needs it: welded, triangles that share an edge wound alike (of each
/// connected part the fewer are turned), and no vertex normals but those of the triangles.
/// \return what of the file is not used, for the user
/// \throw Error (input_invalid) for a one-sided sheet, and for one without triangles
std::vector<std::string> clean_sheet(MeshFile& file);

}  // namespace emmetrope
