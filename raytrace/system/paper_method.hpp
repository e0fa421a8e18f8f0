#pragma once
#include <map>
#include <string>
#include <vector>

#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/system/device_surface.hpp"

namespace emmetrope::raytrace {

/// A sheet as kernels/paper.cl tests it, triangle by triangle; vertex normals are plain means of the unit
/// normals of the faces around a vertex, whatever the mesh brings.
DeviceSurface every_triangle(const TriangleMesh& mesh);

/// Any sheet, folded ones too: a hierarchy of boxes over its triangles, the nearest hit ahead, its own vertex
/// normals.
DeviceSurface sheet_hierarchy(const TriangleMesh& mesh);

/// Where the paper's rays are aimed at: a cap over the surface in front of the retina, as wide as the stop.
/// Its vertex (3, eye frame), signed radius and depth, operation of that surface: as kernels/paper.cl takes
/// them.
/// \param operation_of  of the system without stop: the cap alone bounds the paper's rays
/// \throw Error (input_invalid) when there is no stop, (unsupported) when that surface is tilted
std::vector<float> aim_cap(const EyeModel& eye, const std::map<std::string, int>& operation_of);

}  // namespace emmetrope::raytrace
