#pragma once
#include <array>
#include <vector>

#include "pipeline/eye/meshes/triangle_mesh.hpp"

namespace emmetrope::raytrace {

/// One sphere of a system as the baselines take it, in the order of a ray from the retina.
struct BaselineSphere {
  float vertex_z_mm = 0, curvature_per_mm = 0, ratio = 1;
  float stop_radius_mm = 0;  ///< of the iris in front of this surface; 0: none
};

/// A scalar C++ tracer of spheres, float32, one ray after the other: -O3 -march=native.
/// \param aim  of a pixel: retina point, ellipse centre, matrix (kernels/trace.cl: PIXEL), 12 floats each
///   Returns the mean texture value, so that nothing is optimised away.
double scalar_spheres(const std::vector<BaselineSphere>& spheres, const std::vector<float>& pixels,
                      float aim_z, int samples, const std::vector<float>& texture, int texture_size,
                      float texels_per_mm, float distance_mm, int threads);

/// The same rays against triangle sheets by Embree's rtcIntersect1, one scene a surface, interpolated
/// normals.
/// \param sheets  in the eye's frame with vertex normals
double embree_sheets(const std::vector<TriangleMesh>& sheets, const std::vector<BaselineSphere>& system,
                     const std::vector<float>& pixels, float aim_z, int samples,
                     const std::vector<float>& texture, int texture_size, float texels_per_mm,
                     float distance_mm, int threads);

}  // namespace emmetrope::raytrace
