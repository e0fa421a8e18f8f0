#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/eye/parametric/parametric_eye.hpp"
#include "pipeline/eye/surfaces/shape.hpp"

namespace emmetrope::meshing {

/// An open surface of the fitted eye with one rim, as a map from a disc; eye frame, mm.
class Sheet {
 public:
  virtual ~Sheet() = default;
  /// \param reach  0 at the vertex, 1 on the rim
  /// \param azimuth  radians about the sheet's axis, counter-clockwise as the examiner sees it
  virtual Eigen::Vector3d at(double reach, double azimuth) const = 0;
  /// The point of the surface that belongs to a point close to it; a point beyond the rim goes to the rim.
  virtual Eigen::Vector3d project(const Eigen::Vector3d& close_to_it) const = 0;
  /// Unit normal at a point on the surface, towards the light that comes in.
  virtual Eigen::Vector3d normal(const Eigen::Vector3d& on_it) const = 0;
};

/// A surface with a vertex and a depth behind it, out to `radius_mm` from its own axis.
std::unique_ptr<Sheet> make_height_sheet(const Eigen::Isometry3d& eye_from_surface, ShapePtr shape,
                                         double radius_mm);
/// The vitreo-retinal interface, out to `polar_angle_rad` from the pole in scaled directions.
std::unique_ptr<Sheet> make_globe_sheet(const ParametricEye& eye, double polar_angle_rad);

inline constexpr std::array<const char*, 5> sheet_names{"cornea_anterior", "cornea_posterior",
                                                        "lens_anterior", "lens_posterior", "retina"};

/// A surface to be meshed.
struct NamedSheet {
  std::string name;        ///< of sheet_names: the mesh file's name
  int paper_vertices = 0;  ///< how many Wei, Patkar and Pai (2014) gave this surface
  std::unique_ptr<Sheet> sheet;
};

/// Cornea, lens and retina in the order that light meets them. Corneas reach 6.0 and 5.5 mm from the axis;
/// the lens' sheets its equator, or where they would meet; the retina 105 degrees from the pole, about the
/// ora serrata.
///
/// \param anterior_cornea  the front surface where more is known than the fitted biconic; may be null
/// \param cornea_known_to_mm  how far from the axis it is; not used without it
std::vector<NamedSheet> make_sheets(const ParametricEye& eye, const ShapePtr& anterior_cornea = nullptr,
                                    double cornea_known_to_mm = 0);

}  // namespace emmetrope::meshing
