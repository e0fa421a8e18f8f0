#pragma once
#include <array>
#include <string>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/report/document/document.hpp"

/// A picture of the eye's surfaces in space for readers without the viewer: ray-cast on the processor, as VTK
/// of Debian renders only where there is an X server.
namespace emmetrope::report {

struct StillSurface {
  TriangleMesh mesh_in_eye;
  std::array<double, 3> rgb{1, 1, 1};
  double opacity = 1;
  bool is_cut = false;  ///< its half towards the viewer is taken away
};

/// Where the picture lies: parallel projection of the eye frame.
struct StillView {
  Eigen::Vector3d towards_viewer, right, up;  ///< unit vectors
  Eigen::Vector3d centre_mm{0, 0, 0};
  double mm_per_pixel = 0.1;
  int width_px = 0, height_px = 0;
};

/// From the temporal side, somewhat from the front and above.
StillView still_view(Laterality eye, double axial_length_mm);

/// RGBA, row 0 at the top, 4 bytes a pixel; nothing hit is transparent. Surfaces are lit from both sides.
std::string render_still(const std::vector<StillSurface>& surfaces, const StillView& view);

/// The picture with a scale and the letters of its sides.
Figure still_figure(const std::vector<StillSurface>& surfaces, Laterality eye, double axial_length_mm);

}  // namespace emmetrope::report
