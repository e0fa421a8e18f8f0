#include "segmentation/edges/edge_profile.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Weights of the voxels at -1, 0, 1, 2 (Keys 1981, a = -1/2).
std::array<double, 4> cubic_weights(double t) {
  return {((-0.5 * t + 1) * t - 0.5) * t, (1.5 * t - 2.5) * t * t + 1, ((-1.5 * t + 2) * t + 0.5) * t,
          (0.5 * t - 0.5) * t * t};
}

std::vector<double> smoothed(const std::vector<double>& value, double sigma_steps) {
  const int reach = static_cast<int>(std::ceil(3 * sigma_steps));
  std::vector<double> kernel;
  for (int k = -reach; k <= reach; ++k)
    kernel.push_back(std::exp(-0.5 * k * k / (sigma_steps * sigma_steps)));
  const int count = static_cast<int>(value.size());
  std::vector<double> out(value.size());
  for (int i = 0; i < count; ++i) {
    double sum = 0, weight = 0;
    for (int k = std::max(-reach, -i); k <= std::min(reach, count - 1 - i); ++k) {
      sum += kernel[k + reach] * value[i + k];
      weight += kernel[k + reach];
    }
    out[i] = sum / weight;
  }
  return out;
}

/// Where the profile passes a level going up, at or before step `from`, searched backwards.
double crossing_before(const Profile& profile, std::size_t from, double level) {
  std::size_t i = from;
  while (i > 0 && profile.value[i - 1] > level) --i;
  if (i == 0 || profile.value[i] <= level) return profile.at_mm(i);
  const double low = profile.value[i - 1], high = profile.value[i];
  return profile.at_mm(i - 1) + (level - low) / (high - low) * profile.step_mm;
}

}  // namespace

std::optional<double> interpolate_cubic(const Sampler& sampler, const Vector3d& lps) {
  const auto at = sampler.voxel_coordinates(lps);
  if (!at) return std::nullopt;
  const Stack& stack = sampler.stack();
  const int c = static_cast<int>(std::floor(at->x())), r = static_cast<int>(std::floor(at->y())),
            s = static_cast<int>(std::floor(at->z()));
  if (c < 0 || r < 0 || c + 1 >= stack.columns || r + 1 >= stack.rows) return std::nullopt;
  const auto in_row = cubic_weights(at->x() - c), in_column = cubic_weights(at->y() - r),
             across = cubic_weights(at->z() - s);
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    if (across[k] == 0) continue;
    const int slice = std::clamp(s - 1 + k, 0, stack.slices() - 1);
    for (int j = 0; j < 4; ++j) {
      const int row = std::clamp(r - 1 + j, 0, stack.rows - 1);
      for (int i = 0; i < 4; ++i)
        sum += across[k] * in_column[j] * in_row[i] *
               stack.at(std::clamp(c - 1 + i, 0, stack.columns - 1), row, slice);
    }
  }
  return sum;
}

Profile sample_profile(const Stack& stack, const Tube& tube, double first_mm, double last_mm, double sign,
                       double smoothing_mm) {
  const Sampler sampler(stack);
  Profile profile;
  profile.first_mm = first_mm;
  const auto [u, v] = across(stack, tube.direction);
  const int lines = tube.radius_mm > 0 ? 9 : 1;
  for (int i = 0; profile.at_mm(i) <= last_mm + 1e-9; ++i) {
    double sum = 0;
    for (int line = 0; line < lines; ++line) {
      const double angle = line * pi / 4, radius = line == 8 || lines == 1 ? 0 : tube.radius_mm;
      const auto value = interpolate_cubic(sampler, tube.origin + profile.at_mm(i) * tube.direction +
                                                        radius * (std::cos(angle) * u + std::sin(angle) * v));
      if (!value) return profile.value = smoothed(profile.value, smoothing_mm / profile.step_mm), profile;
      sum += sign * *value;
    }
    profile.value.push_back(sum / lines);
  }
  profile.value = smoothed(profile.value, smoothing_mm / profile.step_mm);
  return profile;
}

std::optional<Edge> first_edge(const Profile& profile, double before, const EdgeRule& rule) {
  const auto& value = profile.value;
  const auto index_of = [&](double mm) {
    return static_cast<std::size_t>(std::lround((mm - profile.first_mm) / profile.step_mm));
  };
  const auto reach = static_cast<std::size_t>(std::lround(1.2 / profile.step_mm));
  const std::size_t first = index_of(std::max(rule.first_mm, profile.at_mm(reach + 1))),
                    last = std::min(index_of(rule.last_mm), value.size() < 2 ? 0 : value.size() - 2);
  const auto slope = [&](std::size_t i) { return value[i + 1] - value[i - 1]; };
  double largest = 0;
  for (std::size_t i = first; i <= last; ++i) largest = std::max(largest, slope(i));
  if (largest <= 0) return std::nullopt;
  for (std::size_t i = first; i <= last; ++i) {
    const bool is_peak = slope(i) > slope(i - 1) && (i == last || slope(i) >= slope(i + 1));
    if (!is_peak || slope(i) < rule.least_slope_share * largest) continue;
    const double low = *std::min_element(value.begin() + static_cast<std::ptrdiff_t>(i - reach),
                                         value.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    const double high = *std::max_element(
        value.begin() + static_cast<std::ptrdiff_t>(i),
        value.begin() + static_cast<std::ptrdiff_t>(std::min(i + reach, value.size() - 1)) + 1);
    if (high - low < rule.least_rise) continue;
    // The plateau, or the shoulder before something brighter still.
    std::size_t top = i;
    while (top + 2 < value.size() && value[top + 1] > value[top] && slope(top) > 0.25 * slope(i) &&
           (slope(top) > 0.6 * slope(i) || slope(top + 1) <= slope(top)))
      ++top;
    Edge edge;
    edge.plateau = value[top];
    edge.steepest_mm = profile.at_mm(i);
    edge.half_level_mm = crossing_before(profile, top, (before + edge.plateau) / 2);
    const double step = rule.typical_step > 0 ? rule.typical_step : edge.plateau - before;
    edge.fixed_half_level_mm = crossing_before(profile, top, before + step / 2);
    return edge;
  }
  return std::nullopt;
}

double median_between(const Profile& profile, double first_mm, double last_mm) {
  std::vector<double> values;
  for (std::size_t i = 0; i < profile.value.size(); ++i)
    if (profile.at_mm(i) >= first_mm && profile.at_mm(i) <= last_mm) values.push_back(profile.value[i]);
  return quantile(values, 0.5);
}

}  // namespace emmetrope::segmentation
