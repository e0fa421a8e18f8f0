#pragma once
#include <string>
#include <vector>

#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/system/optical_system.hpp"

namespace emmetrope::raytrace {

/// Clear radius of a surface without a rim.
constexpr float unlimited_mm = 1e4F;

/// One surface in the form that its kernel takes, in its own frame turned by axis_deg about z.
struct DeviceSurface {
  Operation kind = Operation::quadric;
  double axis_deg = 0;
  double clear_radius_mm = unlimited_mm;
  std::vector<double> parameters;  ///< what stands from place 4 on (kernels/surfaces.cl)
  /// patches: 16 coefficients a cell; triangles: 16 floats each, 32 in a hierarchy
  std::vector<float> records;
  std::vector<float> seeds;  ///< triangles: the grid's (int bits); a hierarchy's nodes
  int columns = 0;           ///< of the grid; for every_triangle the number of triangles
  std::string note;          ///< deviation of a fit from the surface
};

/// \throw Error (unsupported) naming the surface
DeviceSurface device_surface(const Surface& surface, Representation representation, int vertices);

}  // namespace emmetrope::raytrace
