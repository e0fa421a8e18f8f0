#pragma once
#include <Eigen/Core>
#include <functional>

#include "pipeline/eye/parametric/parametric_eye.hpp"

/// The shape of the back of the eye, for any interface that is seen whole from the globe's centre
/// (docs/method/retinal-shape.md). Eye frame about that centre, mm.
namespace emmetrope {

/// Distance of the vitreo-retinal interface from the globe's centre along a unit direction.
using InterfaceDistance = std::function<double(const Eigen::Vector3d& direction)>;
/// \pre the eye outlives it
InterfaceDistance vitreoretinal_interface(const ParametricEye& eye);

/// Largest extent of the interface along a direction, both sides of the centre together.
double globe_extent_mm(const InterfaceDistance& interface, const Eigen::Vector3d& along);

/// Direction at an eccentricity from the pole in a meridian, which is counter-clockwise from the patient's left as the
/// examiner sees it.
Eigen::Vector3d retinal_direction(double eccentricity_rad, double meridian_rad);

/// c of c0 x^2 + c1 y^2 + c2 z^2 + 2 (c3 xy + c4 xz + c5 yz) + c6 x + c7 y + c8 z = 1.
using Quadric = Eigen::Matrix<double, 9, 1>;
/// The quadric that is nearest in the mean square of distances (first order; Taubin 1991) to the interface within a
/// cap about the pole.
/// \param cap_deg  full angle as seen from the globe's centre
Quadric best_quadric(const InterfaceDistance& interface, double cap_deg);

struct BestEllipsoid {
  /// Where its axis points out of the eye: degrees to the patient's left and upwards.
  Eigen::Vector2d axis_deg;
  /// At its vertex, in the horizontal and the vertical meridian.
  Eigen::Vector2d vertex_radius_mm;
  /// Mean of the two meridians' asphericity, (half axis across / half axis along)^2 - 1: above 0 oblate.
  double q = 0;
};
/// The quadric as an ellipsoid with the axis that is nearest to the eye's: where another is nearly as near, a small
/// change of the quadric takes that one instead.
BestEllipsoid as_ellipsoid(const Quadric& quadric);
BestEllipsoid best_ellipsoid(const InterfaceDistance& interface, double cap_deg);

/// Of the interface within a cap of this full angle.
double retinal_area_mm2(const InterfaceDistance& interface, double cap_deg);

/// A lens from behind: a conic of revolution about the eye's axis that ends at its equator.
struct LensBack {
  double vertex_depth_mm;  ///< behind the apex
  double radius_mm, q, equator_radius_mm;
};
/// Inside the interface, behind the lens and the plane of its equator.
/// \param centre_depth_mm  of the globe behind the apex
double vitreous_volume_mm3(const InterfaceDistance& interface, double centre_depth_mm, const LensBack& lens);

/// Where the normal, out of the eye, of the plane through the rim of a cap points: degrees to the patient's left and
/// upwards.
Eigen::Vector2d rim_tilt_deg(const InterfaceDistance& interface, double cap_deg);

/// 337.5 over the smallest radius of curvature (mm) of the interface's sections through the axis within 4.5 mm of the
/// pole, on 12 lines: the macular curvature index of OCT, where all eyes with a staphyloma lie above 40 and none
/// without (BMC Ophthalmology 2024, doi 10.1186/s12886-024-03321-z).
double macular_curvature_index(const InterfaceDistance& interface);

/// Mean curvature, 1/mm, positive for a globe.
double mean_curvature_per_mm(const InterfaceDistance& interface, const Eigen::Vector3d& direction);

/// The sphere that is nearest to the interface within a cap.
struct BestSphere {
  Eigen::Vector3d centre_mm;  ///< from the globe's centre
  double radius_mm = 0;
};
BestSphere best_sphere(const InterfaceDistance& interface, double cap_deg);

}  // namespace emmetrope
