#pragma once
#include <Eigen/Core>
#include <string>

#include "pipeline/base/measured.hpp"
#include "pipeline/eye/instruments/elevation_map.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/surfaces/shape.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope {

/// What a topographer found.
struct Topography {
  ExternalMeasurement toric;  ///< power vector and asphericity of the best toric conicoid
  /// Where in the map the apex of that conicoid lies, by which the map is laid on the eye's
  Eigen::Vector2d apex_mm{0, 0};
  double zone_mm = 0;  ///< diameter of the farthest ring about the apex of which the map has half
  /// Zernike coefficients (order 6) over the zone of the depth beyond that conicoid
  Eigen::VectorXd departure_um;
  Measured irregularity_um;  ///< rms of the departure over the central 6 mm
  /// Of a coefficient over 6 mm: of the coma, by what the map's centring is worth; of each, by the points' noise
  double coma_sigma_um = 0, term_noise_um = 0;
};

/// Best toric conicoid (curvature matrix and one Q) with its own apex, by Gauss-Newton over the central 8 mm;
/// then Zernike terms of what is left about that apex, none larger than the rms of all where a lid hides a part.
///
/// \param sigma_D  one standard deviation of the instrument's meridional power; the asphericity's is 0.05;
///   the noise of the map's points comes on top
///
/// \throw Error (input_invalid) for fewer than 50 points, a map narrower than 6 mm, or one that is not about
///   its apex (1.5 mm)
Topography analyse_topography(const ElevationMap& map, double sigma_D);

/// A sentence where the map's origin is farther from the apex than instruments are, 0.5 mm; else empty.
std::string alignment_warning(const Topography& topography);

/// Zernike terms (OSA, to order 6, um of depth) over the central 6 mm of a cornea's departure from its best
/// toric conicoid.
Eigen::VectorXd corneal_departure_um(const CornealDepth& cornea);
/// Its rms.
double irregularity_um(const CornealDepth& cornea);

/// Depth of an eye's anterior cornea with a departure on top. Of an irregular cornea the topographer's
/// departure replaces the fitted free form: what is left of the eye's own is its best toric conicoid over
/// the central 8 mm.
CornealDepth anterior_cornea(const ParametricEye& eye, const Topography& topography);
/// The same as an optical surface.
ShapePtr anterior_cornea_shape(const ParametricEye& eye, const Topography& topography);

}  // namespace emmetrope
