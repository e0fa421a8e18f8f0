#pragma once
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "raytrace/system/device_surface.hpp"

namespace emmetrope::raytrace {

/// The conic c (x^2 + y^2 + (1 + q) z^2) + 2 z = 0, z counted from `offset_mm` behind the vertex: where a ray
/// meets about the sheet.
struct BaseConic {
  double curvature_per_mm = 0, q = 0, offset_mm = 0;
};

/// A sheet that is a height field over x and y, as kernels/surfaces.cl walks it. Triangles within 6 degrees
/// of the axis are left out.
/// \param mesh  in the shape's frame, with vertex normals
DeviceSurface triangle_walk(const TriangleMesh& mesh, const BaseConic& base);

}  // namespace emmetrope::raytrace
