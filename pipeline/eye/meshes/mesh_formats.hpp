#pragma once
#include <array>
#include <map>
#include <string>
#include <string_view>

#include "pipeline/eye/meshes/triangle_mesh.hpp"

/// Mesh file formats from and to memory; triangle_mesh.cpp adds the file's name to their errors. The parsers
/// check every size against the bytes before they allocate.
/// \throw Error (input_invalid)
namespace emmetrope {

/// What a file says when its coordinates are DICOM patient coordinates.
inline constexpr const char* space_lps = "SPACE=LPS";
/// Takes from a comment or header what it says of the frame.
void note_space(std::string_view comment, MeshFile& file);

MeshFile parse_ply(const std::string& bytes);
MeshFile parse_stl(const std::string& bytes);
MeshFile parse_obj(const std::string& bytes);
MeshFile parse_vtp(const std::string& bytes);

std::string format_ply(const TriangleMesh& mesh, bool says_lps);
std::string format_stl(const TriangleMesh& mesh, bool says_lps);
std::string format_obj(const TriangleMesh& mesh, bool says_lps);
std::string format_vtp(const TriangleMesh& mesh, bool says_lps);

/// A polygon as a fan of triangles.
void add_polygon(TriangleMesh& mesh, const std::vector<int>& corners);

}  // namespace emmetrope
