#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pipeline/eye/meshes/triangle_mesh.hpp"
#include "pipeline/eye/surfaces/shape.hpp"

namespace emmetrope {

/// A C2 surface through a mesh: depth d(x, y) behind a vertex plane as one uniform bicubic B-spline.
///
/// Fit: a conic with a full curvature matrix takes what is smooth and large; a least-squares bicubic spline
/// (with a weak thin-plate term where vertices are sparse) takes the rest; both are then resampled as one
/// spline on a grid fine enough that resampling costs nothing. Vertex normals only say which way the sheet
/// looks: their quality is unknown.
///
/// Cell (i, j), 0 <= i < columns - 3, spans x in [origin.x + (i+1) s, origin.x + (i+2) s] and uses the 4 x 4
/// control values (i..i+3, j..j+3); with t = (x - origin.x)/s - (i+1) in [0, 1] the weights are the uniform
/// cubic B-spline's.
class HeightField {
 public:
  /// Depth with its first and second derivatives.
  struct Jet {
    double depth_mm = 0;
    Eigen::Vector2d gradient{0, 0};
    Eigen::Matrix2d hessian_per_mm = Eigen::Matrix2d::Zero();
  };

  /// \param mesh  in the shape's frame (z out of the eye, d = -z)
  /// \return nothing where the mesh is no height field about the origin (fewer than 12 vertices, folded over)
  static std::optional<HeightField> fit(const TriangleMesh& mesh);

  /// \pre covers(x, y), or close outside: the spline is extended by its outermost cells
  Jet at(double x_mm, double y_mm) const;
  /// Inside the outline (convex hull) of the fitted vertices.
  bool covers(double x_mm, double y_mm) const;
  /// The hit with a half line; nothing outside the outline.
  std::optional<ShapeHit> intersect(const Ray& ray_in_shape) const;

  /// How far the surface passes from the vertices it was fitted to, along the axis, um: vertices beyond a slope
  /// of 2.1 (65 degrees), a globe's equator say, are left out.
  double max_deviation_um() const { return max_deviation_um_; }
  double rms_deviation_um() const { return rms_deviation_um_; }

  /// The grid, for devices: control value (column i, row j) at `controls_mm()[j * columns() + i]`.
  const Eigen::Vector2d& origin_mm() const { return origin_; }
  double spacing_mm() const { return spacing_; }
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  const std::vector<double>& controls_mm() const { return controls_; }
  /// The conic of the fit, a good start for Newton: d = offset + S / (1 + sqrt(1 - (1 + q) T)), S = x'Cx, T =
  /// x'C^2 x.
  double base_offset_mm() const { return base_offset_; }
  const Eigen::Matrix2d& base_curvature_per_mm() const { return base_curvature_; }
  double base_q() const { return base_q_; }
  /// Radius of the smallest circle about the origin that holds the outline, mm.
  double reach_mm() const { return reach_; }

 private:
  /// Points are x, y, depth.
  /// \return whether their outline holds the vertex
  bool outline(const std::vector<Eigen::Vector3d>& points);
  void measure_deviation(const std::vector<Eigen::Vector3d>& points);

  Eigen::Vector2d origin_{0, 0};
  double spacing_ = 1;
  int columns_ = 0, rows_ = 0;
  std::vector<double> controls_;
  std::vector<Eigen::Vector2d> outline_;    ///< convex about the origin, counter-clockwise
  std::vector<double> outline_angles_rad_;  ///< its corners' polar angles, ascending
  double reach_ = 0, inner_reach_ = 0;
  double base_offset_ = 0, base_q_ = 0;
  Eigen::Matrix2d base_curvature_ = Eigen::Matrix2d::Zero();
  double max_deviation_um_ = 0, rms_deviation_um_ = 0;
};

}  // namespace emmetrope
