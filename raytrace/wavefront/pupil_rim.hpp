#pragma once
#include <vector>

namespace emmetrope::raytrace {

/// The edge of a pupil in the reference plane of a wavefront, about the line of sight.
struct PupilRim {
  /// Distances at even angles from +x towards +y, an odd number of them; one alone is a circle's.
  std::vector<double> radius_mm;

  /// Trigonometric interpolation.
  double at(double angle_rad) const;
  /// Of the smallest circle about the line of sight that holds the pupil.
  double largest_mm() const;
  double area_mm2() const;
};

}  // namespace emmetrope::raytrace
