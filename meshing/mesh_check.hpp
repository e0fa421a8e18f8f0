#pragma once
#include "pipeline/base/json.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope::meshing {

/// What optics needs of a sheet, measured.
struct SheetQuality {
  int vertices = 0, triangles = 0;
  double mean_edge_mm = 0;
  double smallest_angle_deg = 0;
  double largest_normal_deviation_deg = 0;  ///< between a triangle's normal and those of its vertices
};

/// Checks with OpenMesh that a mesh is one manifold, consistently oriented sheet with exactly one boundary
/// loop and no handle, that it has no sliver (an angle under 15 degrees) and that its normals agree with its
/// triangles.
///
/// \throw Error (fault) saying what is wrong
SheetQuality check_sheet(const TriangleMesh& mesh);

Json to_json(const SheetQuality& quality);

}  // namespace emmetrope::meshing
