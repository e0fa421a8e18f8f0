#pragma once
#include <Eigen/Core>
#include <optional>

#include "segmentation/edges/edge_ellipsoid.hpp"
#include "segmentation/intake/volume.hpp"
#include "segmentation/intake/weighting.hpp"

/// A plain reader of an eye: half-level edges along rays, an ellipsoid through them, the lens by its contrast.
/// It shares nothing with the fit of the image model but the image, so that its errors are of another kind.
namespace emmetrope::segmentation {

struct EdgeSeed {
  Eigen::Vector3d globe_centre;  ///< LPS, mm
  Eigen::Vector3d axis;          ///< unit, out of the eye
};

/// Distances along the axis from the globe's centre, positive towards the cornea, mm.
struct AxialEdges {
  double inner_cornea_mm = 0, lens_front_mm = 0, lens_back_mm = 0, inner_wall_mm = 0;
};

struct EdgeReading {
  /// Inner wall, by half levels between vitreous and plateau; its horizontal is the patient's.
  EdgeEllipsoid globe;
  /// Of the same wall, its horizontal that of the voxels: what a fit starts from, whatever turns the header.
  Eigen::Vector3d half_axes_along_voxels_mm = {12, 12, 12};
  bool front_is_blanked = false;  ///< then the axis is the seed's, and a lens is where it usually is
  Eigen::Vector3d lens_centre;
  std::optional<AxialEdges> axial;
  double wall_contrast = 0;  ///< the wall's typical step over the vitreous' level, signed as the wall differs
  double rays_with_edge = 0;  ///< share of the rays inside the stack
  double rays_inside = 0;  ///< share of the rays (off the lens) whose wall lies inside the stack, not blanked
  /// In T1: share of the rays whose edge lies behind a place darker than the vitreous, beyond what noise makes as dark
  /// within it. Where fat is displaced away from the eye it leaves no signal, and the edge is the fat's.
  double rays_over_void = 0;
  double rule_spread_mm = 0;  ///< largest difference of a diameter across the axis between three rules
  /// By how much the eye is wider, higher than the ellipsoid by the edges about its ends (both together): no ellipsoid
  /// follows every eye. 0 where they lie inside, as those of ghosts and lids do, or are too few.
  double wider_mm = 0, higher_mm = 0;
  double lens_to_centre_mm() const { return (lens_centre - globe.centre).norm(); }
};

/// Reads the eye near a seed; nothing where there are too few edges.
std::optional<EdgeReading> read_edges(const Stack& stack, const EdgeSeed& seed, Weighting weighting);

}  // namespace emmetrope::segmentation
