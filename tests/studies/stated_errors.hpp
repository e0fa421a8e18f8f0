#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "pipeline/base/measured.hpp"

namespace emmetrope::segmentation {

/// What biometry.json states, and where.
struct StatedQuantity {
  const char *name, *pointer;
};
inline constexpr std::array<StatedQuantity, 18> stated_quantities{
    {{"axial length, mm", "/axial_length_mm"},
     {"globe width, mm", "/globe_width_mm"},
     {"globe height, mm", "/globe_height_mm"},
     {"globe depth, mm", "/globe_depth_mm"},
     {"retina R across, mm", "/retina/vertex_radius_mm/horizontal"},
     {"retina R upright, mm", "/retina/vertex_radius_mm/vertical"},
     {"retina Q, 240 degrees", "/retina/q_240"},
     {"vitreous volume, mm3", "/retina/volume_mm3"},
     {"retinal area, mm2", "/retina/area_mm2"},
     {"anterior chamber depth, mm", "/anterior_chamber_depth_mm"},
     {"lens thickness, mm", "/lens_thickness_mm"},
     {"lens front radius, mm", "/lens_anterior_radius_mm"},
     {"lens back radius, mm", "/lens_posterior_radius_mm"},
     {"corneal thickness, mm", "/corneal_thickness_mm"},
     {"corneal power M, D", "/astigmatism/M_D"},
     {"astigmatism J0, D", "/astigmatism/J0_D"},
     {"astigmatism J45, D", "/astigmatism/J45_D"},
     {"corneal asphericity Q", "/keratometry/asphericity_q"}}};

inline constexpr double normal_95 = 1.959963985;  ///< half a 95 % interval, in standard deviations

inline double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v / static_cast<double>(values.size());
  return std::sqrt(sum);
}

/// Errors of one quantity over the eyes in which it was stated, with the standard deviations that were stated: of an
/// interval with unequal halves that of the half in which the truth is to lie.
struct StatedErrors {
  std::vector<double> error, sigma;

  void add(const Measured& stated, double truth) {
    error.push_back(stated.value - truth);
    const double half = stated.value > truth ? stated.value - stated.ci95[0] : stated.ci95[1] - stated.value;
    sigma.push_back(half / normal_95);
  }

  double mean() const {
    double sum = 0;
    for (const double e : error) sum += e / static_cast<double>(error.size());
    return sum;
  }
  /// Of the errors' sizes.
  double quantile(double share) const {
    std::vector<double> sorted;
    for (const double e : error) sorted.push_back(std::abs(e));
    std::sort(sorted.begin(), sorted.end());
    const auto count = static_cast<double>(sorted.size());
    return sorted[static_cast<std::size_t>(std::min(share * count, count - 1))];
  }
  double median() const { return quantile(0.5); }
  int covered() const {
    int count = 0;
    for (std::size_t i = 0; i < error.size(); ++i) count += std::abs(error[i]) <= normal_95 * sigma[i];
    return count;
  }
  double largest_in_sigmas() const {
    double largest = 0;
    for (std::size_t i = 0; i < error.size(); ++i) largest = std::max(largest, std::abs(error[i]) / sigma[i]);
    return largest;
  }
};

}  // namespace emmetrope::segmentation
