#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

namespace emmetrope::raytrace {

/// Nelder and Mead's simplex in three dimensions, until it is smaller than `tolerance` in every direction.
template <typename Loss>
Eigen::Vector3d minimise(const Loss& loss, const Eigen::Vector3d& start, double step, double tolerance) {
  struct Corner {
    Eigen::Vector3d at;
    double value;
  };
  std::array<Corner, 4> corners;
  corners[0] = {start, loss(start)};
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d at = start + step * Eigen::Vector3d::Unit(k);
    corners[k + 1] = {at, loss(at)};
  }
  for (int iteration = 0; iteration < 200; ++iteration) {
    std::stable_sort(corners.begin(), corners.end(),
                     [](const Corner& a, const Corner& b) { return a.value < b.value; });
    double extent = 0;
    for (int k = 1; k < 4; ++k)
      extent = std::max(extent, (corners[k].at - corners[0].at).cwiseAbs().maxCoeff());
    if (extent < tolerance) break;
    const Eigen::Vector3d centre = (corners[0].at + corners[1].at + corners[2].at) / 3;
    const auto along = [&](double t) {
      const Eigen::Vector3d at = centre + t * (corners[3].at - centre);
      return Corner{at, loss(at)};
    };
    Corner moved = along(-1);
    if (moved.value < corners[0].value) {
      const Corner further = along(-2);
      corners[3] = further.value < moved.value ? further : moved;
    } else if (moved.value < corners[2].value) {
      corners[3] = moved;
    } else {
      moved = moved.value < corners[3].value ? along(-0.5) : along(0.5);
      if (moved.value < corners[3].value) {
        corners[3] = moved;
      } else {
        for (int k = 1; k < 4; ++k) {
          corners[k].at = (corners[k].at + corners[0].at) / 2;
          corners[k].value = loss(corners[k].at);
        }
      }
    }
  }
  return std::min_element(corners.begin(), corners.end(),
                          [](const Corner& a, const Corner& b) { return a.value < b.value; })
      ->at;
}

}  // namespace emmetrope::raytrace
