#pragma once
#include <Eigen/Geometry>
#include <filesystem>

#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope::meshing {

/// Writes a GIfTI surface (.surf.gii, NITRC GIfTI 1.0): points and normals turned from LPS into the RAS
/// scanner frame that NIfTI uses, and triangles; text encoding, float32.
///
/// \throw Error (not_writable)
void write_gifti(const std::filesystem::path& file, const TriangleMesh& mesh_in_lps);

}  // namespace emmetrope::meshing
