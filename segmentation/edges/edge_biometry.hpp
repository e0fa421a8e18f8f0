#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "segmentation/edges/edge_reader.hpp"

/// An edge reading in the quantities of biometry, each with what such a reading is worth.
namespace emmetrope::segmentation {

/// A number and its standard deviation.
struct Estimate {
  double value = 0, sigma = 0;
};

/// As biometry.json defines them; mm.
struct EdgeBiometry {
  Estimate centre;  ///< sigma of each coordinate of the globe's centre; the value is 0
  Estimate globe_width, globe_height, globe_depth;
  /// Apex to the vitreo-retinal interface at the pole; none where cornea or lens have no edges of their own.
  std::optional<Estimate> axial_length, anterior_chamber_depth, lens_thickness;
};
/// Of a globe that is read from its back and sides alone: heads blanked on purpose against their whole images. Where cornea
/// and lens have no edges, or a fit speaks against them, their place is not seen either: two of 59 phantom eyes of `orbit`
/// were 3.0 and 4.2 mm too deep then.
inline constexpr double depth_sigma_without_front_mm = 2;
EdgeBiometry edge_biometry(const EdgeReading& reading, const Stack& stack, Weighting weighting);

/// Eye frame of a reading: its origin at the apex, a usual distance before the globe's centre where the cornea
/// is not seen.
Eigen::Isometry3d frame_of(const EdgeReading& reading);

/// An eye that was read, by someone who is sure that it is one.
struct ReadEye {
  EdgeReading reading;
  EdgeBiometry biometry;
};
/// Nothing where there is doubt about the globe.
std::optional<ReadEye> read_eye(const Stack& stack, const EdgeSeed& seed, Weighting weighting);

/// The corneal apex from the globe's centre: a cornea's usual thickness before its inner edge.
double apex_distance_mm(const AxialEdges& axial);

/// Why what was read may be the edge of displaced fat; empty where nothing speaks for it.
std::string doubt_about_fat(const EdgeReading& reading);

/// Why what was read may be no eye, or not its wall; empty where nothing speaks against it.
std::string doubt_about_globe(const EdgeReading& reading);

}  // namespace emmetrope::segmentation
