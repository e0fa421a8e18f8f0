#pragma once
#include <Eigen/Geometry>
#include <optional>

#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/report/document/document.hpp"

/// Maps of the anterior cornea, from its mesh, as a topographer draws them.
namespace emmetrope::report {

/// Values on a square grid, row 0 at the bottom (smallest y); NaN where the mesh does not reach.
struct CorneaGrid {
  int side = 0;
  double half_width_mm = 0;
  std::vector<double> depth_mm;       ///< behind the apex plane
  std::vector<double> axial_power_D;  ///< 337.5 over the axial radius r / sin(angle of the normal)
  std::vector<double> elevation_um;   ///< above the best-fit sphere (positive towards the viewer)
  double best_sphere_radius_mm = 0;
};

/// \param mesh_in_eye  eye frame, with normals
CorneaGrid cornea_grid(const TriangleMesh& mesh_in_eye, double half_width_mm, int side);

struct Meridians {
  double flat_axis_deg = 0, steep_axis_deg = 0;
};

/// Axial power map, with its meridians where they are determined; false where gnuplot is missing.
bool draw_axial_power(Figure& figure, const CorneaGrid& grid, const std::optional<Meridians>& meridians,
                      bool is_right_eye);
bool draw_elevation(Figure& figure, const CorneaGrid& grid, bool is_right_eye);

}  // namespace emmetrope::report
