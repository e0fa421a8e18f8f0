#include "raytrace/wavefront/pupil_rim.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::raytrace {

double PupilRim::at(double angle_rad) const {
  const auto count = static_cast<int>(radius_mm.size());
  double sum = 0;
  for (int k = 0; k < count; ++k) {
    const double half = 0.5 * (angle_rad - 2 * pi * k / count), sine = std::sin(half);
    if (std::abs(sine) < 1e-12) return radius_mm[k];
    sum += radius_mm[k] * std::sin(count * half) / (count * sine);  // Dirichlet's kernel
  }
  return sum;
}

double PupilRim::largest_mm() const {
  if (radius_mm.size() == 1) return radius_mm.front();
  constexpr int angles = 360;
  constexpr double step = 2 * pi / angles;
  double best = 0;
  for (int k = 1; k < angles; ++k)
    if (at(k * step) > at(best)) best = k * step;
  double low = best - step, high = best + step;  // with the maximum between
  for (int third = 0; third < 40; ++third) {
    const double left = low + (high - low) / 3, right = high - (high - low) / 3;
    (at(left) < at(right) ? low : high) = at(left) < at(right) ? left : right;
  }
  return at((low + high) / 2);
}

double PupilRim::area_mm2() const {
  double sum = 0;
  for (const double radius : radius_mm) sum += radius * radius;
  return pi * sum / static_cast<double>(radius_mm.size());
}

}  // namespace emmetrope::raytrace
