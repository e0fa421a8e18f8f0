#include "pipeline/base/even_points.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace emmetrope {
namespace {

using Eigen::Vector3d;

double distance_to_nearest(const Vector3d& point, const std::vector<Vector3d>& points, double beyond) {
  double nearest = 2;
  for (const Vector3d& other : points)
    if (const double distance = (other - point).norm(); distance >= beyond)
      nearest = std::min(nearest, distance);
  return nearest;
}

TEST(MirroredDirections, AreTheirOwnMirrorImagesAndAboutAsFarApart) {
  for (const int count : {124, 900}) {
    const std::vector<Vector3d> directions = mirrored_directions(count);
    EXPECT_NEAR(static_cast<double>(directions.size()), count, 0.05 * count);
    const double apart = std::sqrt(4 * pi / count);
    Vector3d sum = Vector3d::Zero();
    for (const Vector3d& direction : directions) {
      EXPECT_NEAR(direction.norm(), 1, 1e-12);
      for (int axis = 0; axis < 3; ++axis) {
        Vector3d mirrored = direction;
        mirrored[axis] *= -1;
        EXPECT_LT(distance_to_nearest(mirrored, directions, 0), 1e-12) << direction.transpose();
      }
      const double next = distance_to_nearest(direction, directions, 1e-6);
      EXPECT_GT(next, 0.7 * apart) << direction.transpose();
      EXPECT_LT(next, 1.2 * apart) << direction.transpose();
      sum += direction;
    }
    EXPECT_LT(sum.norm(), 1e-9);
  }
}

}  // namespace
}  // namespace emmetrope
