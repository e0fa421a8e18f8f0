#pragma once
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope::raytrace {

/// A formula as a triangle sheet with exactly `vertices` vertices on the surface and its own normals there,
/// in the shape's frame: rings about the vertex.
/// \param semi_diameter_mm  lowered to where the shape still reaches
/// \param jitter  share of the spacing by which vertices are moved at random (the rim only along itself)
TriangleMesh sheet_mesh(const Shape& shape, double semi_diameter_mm, int vertices, double jitter);

/// The surface's clear radius, or what an eye needs: 5.5 mm where the shape reaches that far.
double default_semi_diameter_mm(const Surface& surface);

}  // namespace emmetrope::raytrace
