#pragma once
#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace emmetrope {

/// A triangle mesh; lengths in mm, in the frame that whoever made it says.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector3d> normals;  ///< unit vertex normals, as many as vertices, or none
  /// counter-clockwise seen from the side that the normals point to
  std::vector<std::array<int, 3>> triangles;
};

/// Vertices at one place become one, in order of appearance; those of no triangle go, and triangles without three
/// corners or that are there twice. Normals go where one place has several: they are of faces, not of the surface.
/// \return whether normals went
bool weld(TriangleMesh& mesh);

/// A mesh as it was read, with what its file says of its frame.
struct MeshFile {
  TriangleMesh mesh;
  bool says_lps = false;          ///< the file carries a SPACE=LPS comment (or VTP field)
  bool says_ras = false;          ///< the same with RAS, as 3D Slicer may write it
  bool has_face_normals = false;  ///< and none of vertices: they are left out
};

/// Reads PLY (text, binary), STL (text, binary), OBJ or VTP, chosen by the file's ending. Sizes that the
/// header promises are checked against the file before anything is allocated.
/// \throw Error (input_invalid) naming file and fault; (unsupported) for other endings
MeshFile read_mesh(const std::filesystem::path& file);

/// Writes PLY (binary, little endian, float64 coordinates, with normals where there are any), STL, OBJ or VTP
/// by the file's ending; whole or not at all.
/// \param says_lps  the coordinates are LPS: a SPACE=LPS comment is written
void write_mesh(const std::filesystem::path& file, const TriangleMesh& mesh, bool says_lps);

}  // namespace emmetrope
