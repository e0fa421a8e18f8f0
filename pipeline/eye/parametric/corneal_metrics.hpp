#pragma once
#include <Eigen/Core>
#include <functional>

#include "pipeline/eye/parametric/parametric_eye.hpp"

namespace emmetrope {

/// Depth of the anterior cornea behind its apex at (x, y), mm; rotationally anything.
using CornealDepth = std::function<double(double x_mm, double y_mm)>;
/// That of an eye's fitted biconic.
/// \pre the eye outlives it
CornealDepth anterior_cornea(const ParametricEye& eye);

/// Radius of the ring on which keratometry is defined here.
inline constexpr double keratometry_ring_mm = 1.5;

/// Axial radius in the meridian `azimuth` at `r_mm` from the apex: distance along the normal's slope to the
/// axis. On a conic sqrt(R0^2 - Q r^2).
double axial_radius_mm(const CornealDepth& depth, double r_mm, double azimuth_rad);

/// Keratometry as a power vector.
struct CornealPower {
  double M_D = 0;    ///< mean of the flat and the steep meridian
  double J0_D = 0;   ///< (steep - flat)/2 cos 2 a_flat
  double J45_D = 0;  ///< (steep - flat)/2 sin 2 a_flat
};
/// From the meridians in which the keratometric power is extreme; a meridian's power is the mean of its two
/// halves.
CornealPower corneal_power(const CornealDepth& depth);

/// Mean over 36 meridians of the Q of the best conic over the central 8 mm.
double asphericity(const CornealDepth& depth);

/// Width of the section at `depth_mm` behind the apex in a meridian (both sides of the apex together).
///
/// \throw Error (no_result) when the surface does not get that deep within 9 mm
double section_width_mm(const CornealDepth& depth, double depth_mm, double azimuth_rad);

/// Zernike coefficients (OSA order and normalisation) of the height z = -depth over a zone about the apex,
/// um.
Eigen::VectorXd corneal_zernike_um(const CornealDepth& depth, double zone_mm, int order);

}  // namespace emmetrope
