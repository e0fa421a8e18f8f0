#pragma once
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "tests/support/sheet.hpp"

namespace emmetrope::testing_eye {

/// The eye with its optical surfaces as irregular meshes.
inline EyeModel meshed(const EyeModel& eye, int vertices, MeshInterpolation interpolation, bool own_normals,
                       double semi_diameter_mm = 5) {
  EyeModel result = eye;
  unsigned seed = 1;
  for (Surface& surface : result.surfaces) {
    if (surface.is_stop() || surface.name == "retina") continue;
    TriangleMesh mesh = jittered_sheet(*surface.shape, semi_diameter_mm, vertices, seed++);
    if (!own_normals) mesh.normals.clear();
    for (Eigen::Vector3d& v : mesh.vertices) v.z() -= surface.position_mm;
    surface = make_mesh_surface(surface.name, mesh, surface.medium_after, interpolation);
  }
  return result;
}

/// Rms angle between exit directions of rays from +-3 mm of retina through the 4 mm stop.
inline double exit_error_arcmin(const EyeModel& exact, const EyeModel& approximate) {
  const ExactTracer truth(exact, exact.reference_wavelength_nm),
      other(approximate, exact.reference_wavelength_nm);
  const Surface& retina = exact.retina();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  double square = 0;
  int count = 0;
  while (count < 3000) {
    const double x = 6 * unit(random) - 3, y = 6 * unit(random) - 3;
    const Eigen::Vector3d from(x, y, -retina.position_mm - *retina.shape->depth_mm(x, y));
    const double angle = 2 * pi * unit(random), radius = 2.1 * std::sqrt(unit(random));
    const Eigen::Vector3d to(radius * std::cos(angle), radius * std::sin(angle), -3.7);
    const Ray ray{from, (to - from).normalized()};
    const ExactTracer::End a = truth.trace_end(ray), b = other.trace_end(ray);
    if (a.state != RayState::reached || b.state != RayState::reached) continue;
    square += a.direction.cross(b.direction).squaredNorm();
    ++count;
  }
  return std::sqrt(square / count) / (degree / 60);
}

}  // namespace emmetrope::testing_eye
