#pragma once
#include <Eigen/Core>
#include <filesystem>

#include "pipeline/base/measured.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/surfaces/shape.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope {

/// Elevation of an anterior cornea about its apex, eye frame's x and y.
struct ElevationMap {
  Eigen::MatrixX2d position_mm;
  Eigen::VectorXd depth_mm;  ///< behind the apex plane
};

/// Reads a map from
/// - CSV with the columns x_mm, y_mm and elevation_um or elevation_mm;
/// - CSV with a matrix: elevation_um (or _mm) in the first cell, x in mm along the first row, y in mm down
/// the first column;
/// - JSON {"zone_mm": diameter, "zernike_um": [coefficients of the height, OSA order]}.
/// Empty cells and nan are gaps. Heights and depths are told apart by the cornea's convexity.
///
/// \throw Error (input_invalid) naming file and line or key
ElevationMap read_elevation_map(const std::filesystem::path& file);

/// What a topographer found.
struct Topography {
  ExternalMeasurement toric;  ///< power vector and asphericity of the best toric conicoid
  double zone_mm = 0;         ///< diameter of the map
  /// Zernike coefficients (order 6) over the zone of the depth beyond that conicoid
  Eigen::VectorXd departure_um;
  Measured irregularity_um;  ///< rms of the departure over the central 6 mm
};

/// Best toric conicoid (curvature matrix and one Q) with the map's own piston and tilt, by Gauss-Newton over
/// the central 8 mm; then Zernike terms of what is left.
///
/// \param sigma_D  one standard deviation of the instrument's meridional power; the asphericity's is 0.05
///
/// \throw Error (input_invalid) for fewer than 50 points or a map narrower than 6 mm
Topography analyse_topography(const ElevationMap& map, double sigma_D);

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
