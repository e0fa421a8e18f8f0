#pragma once
#include "meshing/sheet.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope::meshing {

/// Meshes a sheet with triangles of about one edge length: CGAL's isotropic remeshing (Botsch and Kobbelt
/// 2004) of a ring mesh, each vertex kept on the surface, rim vertices fixed. Normals are the surface's own.
/// \pre 0 < edge_mm, small against the sheet
TriangleMesh mesh_with_edge(const Sheet& sheet, double edge_mm);

/// The same with an exact number of vertices: the edge length is searched, the last few vertices are added on
/// the longest edges or taken from the shortest.
///
/// \throw Error (usage) for fewer than 60 vertices or more than 200 000
TriangleMesh mesh_with_vertices(const Sheet& sheet, int vertices);

}  // namespace emmetrope::meshing
