#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <vector>

namespace emmetrope {

/// Elevation of an anterior cornea about its apex, eye frame's x and y.
struct ElevationMap {
  Eigen::MatrixX2d position_mm;
  Eigen::VectorXd depth_mm;  ///< behind the apex plane
};

struct ElevationPoint {
  double x_mm, y_mm, depth_mm;
};
ElevationMap elevation_map(const std::vector<ElevationPoint>& points);

/// More than the 28 Zernike terms that describe a map.
inline constexpr Eigen::Index fewest_elevations = 50;

/// Reads a map from
/// - CSV with the columns x_mm, y_mm and elevation_um or elevation_mm;
/// - CSV with a matrix: elevation_um (or _mm) in the first cell, x in mm along the first row, y in mm down
/// the first column;
/// - JSON {"zone_mm": diameter, "zernike_um": [coefficients of the height, OSA order]}.
/// Empty cells and nan are gaps. Heights and depths are told apart by the cornea's convexity.
///
/// \throw Error (input_invalid) naming file and line or key
ElevationMap read_elevation_map(const std::filesystem::path& file);

}  // namespace emmetrope
