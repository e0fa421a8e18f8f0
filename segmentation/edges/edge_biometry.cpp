#include "segmentation/edges/edge_biometry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/limits.hpp"
#include "pipeline/eye/population/population.hpp"
#include "segmentation/finding/lens_axis.hpp"

namespace emmetrope::segmentation {
namespace {

/// How far half levels lie from the surfaces that they stand for, and how well that is known. T2: random phantom
/// eyes of 0.6 mm voxels, where lines as thin as the cornea draw the edge to the fluid; the spread is that
/// between scanners, chosen. T1: on real scans whose retina has a bright rim half levels are right to 0.3 mm;
/// where the wall is as dark as the vitreous the first edge is that of the fat, 1.2 mm outside it and more where
/// chemical shift displaces it (docs/method/edges.md).
struct EdgeBias {
  Estimate across, length, chamber, lens;
};
EdgeBias bias_of(Weighting weighting) {
  if (weighting == Weighting::t2) return {{-0.1, 0.3}, {-0.35, 0.4}, {-0.1, 0.25}, {-0.1, 0.25}};
  return {{0, 0.6}, {0.1, 0.8}, {0.1, 0.35}, {0, 0.35}};
}

Estimate without_bias(double value, const Estimate& bias, double other_sigma) {
  return {value - bias.value, std::hypot(bias.sigma, other_sigma)};
}

/// Slices blur what lies across them.
double slice_sigma_mm(const Stack& stack) {
  return 0.12 * std::max(stack.slice_thickness_mm, stack.slice_spacing_mm());
}

double lens_mm(const AxialEdges& axial) { return axial.lens_front_mm - axial.lens_back_mm; }
double chamber_mm(const AxialEdges& axial) { return apex_distance_mm(axial) - axial.lens_front_mm; }
double length_mm(const AxialEdges& axial) { return apex_distance_mm(axial) - axial.inner_wall_mm; }

bool are_an_eyes(const AxialEdges& axial) {
  const Range lens{2.5, 6.5}, chamber{1.5, 5.5};
  return lens.contains(lens_mm(axial)) && chamber.contains(chamber_mm(axial)) &&
         limits_of("axial_length_mm").accepted.contains(length_mm(axial));
}

}  // namespace

double apex_distance_mm(const AxialEdges& axial) {
  return axial.inner_cornea_mm + population_value("cornea_thickness_mm").mean;
}

EdgeBiometry edge_biometry(const EdgeReading& reading, const Stack& stack, Weighting weighting) {
  const EdgeBias bias = bias_of(weighting);
  const double scatter_mm = 0.5 * reading.globe.rms_mm;
  const double sigma_mm = std::hypot(slice_sigma_mm(stack), scatter_mm);
  const double across_mm = std::hypot(sigma_mm, reading.rule_spread_mm);
  EdgeBiometry biometry;
  biometry.centre = {0, std::hypot(0.3, sigma_mm)};
  // Half of what lies past the ellipsoid's ends: an interval reaches to both.
  biometry.globe_width = without_bias(2 * reading.globe.half_axes[0], bias.across,
                                      std::hypot(across_mm, 0.5 * reading.wider_mm));
  biometry.globe_height = without_bias(2 * reading.globe.half_axes[1], bias.across,
                                       std::hypot(across_mm, 0.5 * reading.higher_mm));
  biometry.globe_depth =
      without_bias(2 * reading.globe.half_axes[2], bias.across,
                   std::hypot(across_mm, reading.axial ? 0 : depth_sigma_without_front_mm));
  if (!reading.axial) return biometry;
  const AxialEdges& axial = *reading.axial;
  biometry.axial_length = without_bias(length_mm(axial), bias.length, sigma_mm);
  biometry.anterior_chamber_depth = without_bias(chamber_mm(axial), bias.chamber, sigma_mm);
  biometry.lens_thickness = without_bias(lens_mm(axial), bias.lens, sigma_mm);
  return biometry;
}

Eigen::Isometry3d frame_of(const EdgeReading& reading) {
  constexpr double usual_apex_mm = 12.3;
  const double apex_mm = reading.axial ? apex_distance_mm(*reading.axial) : usual_apex_mm;
  const Eigen::Vector3d outward = reading.globe.axes.col(2);
  return lps_from_eye(reading.globe.centre + apex_mm * outward, outward);
}

std::optional<ReadEye> read_eye(const Stack& stack, const EdgeSeed& seed, Weighting weighting) {
  auto reading = read_edges(stack, seed, weighting);
  if (!reading || !doubt_about_globe(*reading).empty()) return std::nullopt;
  if (reading->axial && !are_an_eyes(*reading->axial)) reading->axial.reset();
  return ReadEye{*reading, edge_biometry(*reading, stack, weighting)};
}

std::string doubt_about_fat(const EdgeReading& reading) {
  if (limits_of("rays_over_void_t1").accepted.contains(reading.rays_over_void)) return {};
  return fmt::format(
      "in {:.0f} % of the directions there is no signal before what was taken for its wall: fat is displaced "
      "by the chemical shift, and its edge was taken for the eye's",
      100 * reading.rays_over_void);
}

std::string doubt_about_globe(const EdgeReading& reading) {
  // Right readings of ordinary scans have 0.75 to 0.98, 0.8 to 1.0 and 0.2 to 0.75 mm.
  constexpr double least_kept = 0.75, least_edges = 0.75, least_inside = 0.85, largest_rms_mm = 0.85;
  if (reading.rays_inside < least_inside)
    return fmt::format("{:.0f} % of its wall lies inside the images", 100 * reading.rays_inside);
  if (reading.rays_with_edge < least_edges)
    return fmt::format("its wall has an edge in {:.0f} % of the directions", 100 * reading.rays_with_edge);
  if (reading.globe.kept_share < least_kept)
    return fmt::format("{:.0f} % of its edges lie on one ellipsoid", 100 * reading.globe.kept_share);
  if (reading.globe.rms_mm > largest_rms_mm)
    return fmt::format("its edges scatter by {:.1f} mm about an ellipsoid", reading.globe.rms_mm);
  for (const auto& [quantity, axis] : {std::pair{"globe_width_mm", 0}, std::pair{"globe_height_mm", 1}}) {
    const double extent_mm = 2 * reading.globe.half_axes[axis];
    if (!limits_of(quantity).plausible.contains(extent_mm))
      return fmt::format("a globe of {:.1f} mm is no eye's", extent_mm);
  }
  // Of a ball of the same volume. Right readings of real heads have up to 27.0 mm; of an eye 33 mm long and 26 mm across it
  // is 28. Edges of a scleral buckle in T1 had 30.2 mm, around a globe of 23.
  constexpr double largest_mean_diameter_mm = 29;
  const double mean_diameter_mm = 2 * std::cbrt(reading.globe.half_axes.prod());
  if (mean_diameter_mm > largest_mean_diameter_mm)
    return fmt::format("a globe of {:.1f} mm on the average is no eye's", mean_diameter_mm);
  if (std::string doubt = doubt_about_fat(reading); !doubt.empty()) return doubt;
  const double gaze_deg = from_ahead_deg(reading.globe.axes.col(2));
  if (!limits_of("gaze_from_ahead_deg").accepted.contains(gaze_deg))
    return fmt::format("it looks {:.0f} degrees away from straight ahead", gaze_deg);
  const double lens_mm = reading.lens_to_centre_mm();
  if (lens_mm < 6 || lens_mm > 11.5)
    return fmt::format("what was taken for its lens lies {:.1f} mm from its centre", lens_mm);
  return {};
}

}  // namespace emmetrope::segmentation
