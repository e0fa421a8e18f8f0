#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "segmentation/finding/sampling.hpp"
#include "segmentation/intake/volume.hpp"

/// Image intensity along lines, and where it steps up.
namespace emmetrope::segmentation {

/// Intensity at equal steps along a line.
struct Profile {
  double first_mm = 0, step_mm = 0.1;
  std::vector<double> value;

  double at_mm(std::size_t i) const { return first_mm + static_cast<double>(i) * step_mm; }
  bool covers(double mm) const { return !value.empty() && at_mm(value.size() - 1) >= mm; }
};

/// Interpolation by cubic convolution (Keys 1981) over 4 x 4 x 4 voxels; absent outside the stack or inside a
/// gap.
std::optional<double> interpolate_cubic(const Sampler& sampler, const Eigen::Vector3d& lps);

/// A bundle of parallel lines averaged: one in the middle and, for a radius, eight on the circle.
struct Tube {
  Eigen::Vector3d origin, direction;
  double radius_mm = 0;
};
/// Ends where the stack does.
/// \param sign  multiplies the intensity, so that what is sought is a rise
/// \param smoothing_mm  standard deviation of the Gaussian along the line
Profile sample_profile(const Stack& stack, const Tube& tube, double first_mm, double last_mm, double sign,
                       double smoothing_mm);

/// A rise of a profile.
struct Edge {
  double half_level_mm = 0;        ///< half way between the level before and the plateau after
  double steepest_mm = 0;          ///< the largest slope
  double fixed_half_level_mm = 0;  ///< half way up the typical step
  double plateau = 0;              ///< where the rise ends, or has a shoulder
};
/// What rises count.
struct EdgeRule {
  double first_mm = 8, last_mm = 15.5;
  double least_slope_share = 0.4;  ///< of the profile's largest slope
  double least_rise = 0;           ///< within 1.2 mm
  double typical_step = 0;         ///< of the third rule; 0: the profile's own
};
/// The first rise that counts.
/// \param before  the level that the profile rises from
std::optional<Edge> first_edge(const Profile& profile, double before, const EdgeRule& rule);

/// Median over a range of the line; 0 where there is none.
double median_between(const Profile& profile, double first_mm, double last_mm);

}  // namespace emmetrope::segmentation
