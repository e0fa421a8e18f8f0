#pragma once
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "pipeline/base/json.hpp"

namespace emmetrope {

/// A half line. `direction` is a unit vector.
struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
};

/// Hits this little behind the origin still count: surfaces may touch.
inline constexpr double behind_mm = 1e-9;

/// Where a ray meets a shape.
struct ShapeHit {
  double distance_mm = 0;
  Eigen::Vector3d position;
  Eigen::Vector3d normal;  ///< unit, with positive z (out of the eye)
};

/// The parameters of a surface's formula, by its kind: what make_plane() and its like take.
struct PlaneFormula {};
struct SphereFormula {
  double radius_mm = 0;
};
struct ConicFormula {
  double radius_mm = 0, q = 0;
};
struct EllipsoidFormula {
  Eigen::Vector3d semi_axes_mm;
  double axis_deg = 0;
};
struct BiconicFormula {
  Eigen::Vector2d radius_mm, q;
  double axis_deg = 0;
};
struct ZernikeFormula {
  BiconicFormula biconic;
  double norm_radius_mm = 0;
  std::vector<double> coefficients_um;
};
/// std::monostate: the surface has no formula, as a mesh has none.
using SurfaceFormula = std::variant<std::monostate, PlaneFormula, SphereFormula, ConicFormula,
                                    EllipsoidFormula, BiconicFormula, ZernikeFormula>;

/// The form of an optical surface in its own frame: origin at the vertex, z out of the eye like the eye's
/// frame. Its depth d(x, y) behind the vertex plane is the textbook sag: z = -d. Radii are positive where the
/// centre of curvature lies deeper than the vertex.
///
/// A new type: one class derived from this one, and one line in the table of `shape_from_json` (shape.cpp).
/// Where it returns no formula, devices take it by its depth and normals.
class Shape {
 public:
  virtual ~Shape() = default;

  /// The name in eye.json: "sphere", "conic", "biconic", "ellipsoid", "zernike", "mesh", "plane".
  virtual std::string type() const = 0;
  /// Depth behind the vertex plane, mm; nothing where the surface does not reach (x, y).
  virtual std::optional<double> depth_mm(double x_mm, double y_mm) const = 0;
  /// Unit normal with positive z at (x, y).
  virtual std::optional<Eigen::Vector3d> normal(double x_mm, double y_mm) const = 0;
  /// The hit on the sheet that holds the vertex, from either side; float64, to 1e-12 mm for closed forms.
  virtual std::optional<ShapeHit> intersect(const Ray& ray_in_shape) const = 0;
  /// Curvature at the vertex, 1/mm, textbook sign: [[c_xx, c_xy], [c_xy, c_yy]].
  virtual Eigen::Matrix2d vertex_curvature() const = 0;
  virtual SurfaceFormula formula() const { return {}; }
  /// Conic constants of its two meridians; 0 where the form has none.
  virtual Eigen::Vector2d asphericity() const { return {0, 0}; }
  /// The keys of eye.json that describe the form ("type", "radius_mm", "q", "axis_deg", ...).
  virtual Json to_json() const = 0;
};

using ShapePtr = std::shared_ptr<const Shape>;

ShapePtr make_plane();
ShapePtr make_sphere(double radius_mm);
/// \param q  asphericity (conic constant): z-axis conic, 0 a sphere, -1 a paraboloid
ShapePtr make_conic(double radius_mm, double q);
/// d = (x^2/Rx + y^2/Ry) / (1 + sqrt(1 - (1+Qx) x^2/Rx^2 - (1+Qy) y^2/Ry^2)), x along the meridian
/// `axis_deg`.
ShapePtr make_biconic(double radius_x_mm, double radius_y_mm, double q_x, double q_y, double axis_deg);
/// The vertex cap of an ellipsoid with half axes (x, y, z), vertex at its near pole; z > 0 for a centre
/// deeper than the vertex, z < 0 for one in front of it (a retina).
ShapePtr make_ellipsoid(const Eigen::Vector3d& semi_axes_mm, double axis_deg);
/// A biconic (x along the meridian `axis_deg`) plus sum_j c_j Z_j(x/r, y/r): OSA order and normalisation,
/// micrometres of depth, x and y in the surface's frame turned by axis_deg as well.
ShapePtr make_zernike(double radius_x_mm, double radius_y_mm, double q_x, double q_y, double axis_deg,
                      double norm_radius_mm, const std::vector<double>& coefficients_um);

/// The same surface turned about its own z, counter-clockwise as the examiner sees it.
/// \pre it has a formula
ShapePtr turned_about_axis(const ShapePtr& shape, double angle_deg);

class CheckedObject;
/// A shape from the keys of one entry of eye.json's "surfaces" that describe its form, "type" read already;
/// not a mesh, which eye_json.cpp reads with its file.
/// \throw Error (input_invalid) naming the key
ShapePtr shape_from_json(const std::string& type, CheckedObject& surface);

}  // namespace emmetrope
