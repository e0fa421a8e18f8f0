#include "raytrace/retina/geodesic.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector3d;

EyeModel with_retina(const ShapePtr& shape) {
  EyeModel eye = make_eye("navarro");
  eye.surfaces.back().shape = shape;
  return eye;
}

TEST(Geodesic, OnASphereIsAGreatCircle) {
  const EyeModel eye = with_retina(make_sphere(-12));
  const Vector3d centre(0, 0, 12 - eye.axial_length_mm());
  std::mt19937 random(3);
  std::normal_distribution<double> side;
  for (int k = 0; k < 20; ++k) {
    Vector3d a(side(random), side(random), -2), b(side(random), side(random), -2);
    a.normalize();
    b.normalize();
    const auto way_mm = geodesic_mm(eye, centre + 12 * a, centre + 12 * b);
    ASSERT_TRUE(way_mm);
    EXPECT_NEAR(*way_mm, 12 * std::atan2(a.cross(b).norm(), a.dot(b)), 1e-5);
  }
  EXPECT_EQ(geodesic_mm(eye, centre - Vector3d(0, 0, 12), centre - Vector3d(0, 0, 12)), 0.0);
}

/// Where one gets who goes straight on along an ellipsoid: the equation of geodesics, integrated.
struct Walk {
  Vector3d semi_axes_mm, place, heading;

  Vector3d normal(const Vector3d& at) const {
    return at.cwiseQuotient(semi_axes_mm.cwiseProduct(semi_axes_mm)).normalized();
  }
  /// Curvature turns the heading towards the inside: x'' = -n (x' G x') / |g| with g the gradient and G half its slope.
  Vector3d acceleration(const Vector3d& at, const Vector3d& along) const {
    const Vector3d inverse = semi_axes_mm.cwiseProduct(semi_axes_mm).cwiseInverse();
    const Vector3d gradient = inverse.cwiseProduct(at);
    return -gradient * along.dot(inverse.cwiseProduct(along)) / gradient.squaredNorm();
  }
  Vector3d after(double length_mm) {
    constexpr int steps = 4000;
    const double h = length_mm / steps;
    for (int k = 0; k < steps; ++k) {  // Runge and Kutta's fourth order
      const Vector3d v1 = heading, a1 = acceleration(place, v1);
      const Vector3d v2 = heading + h / 2 * a1, a2 = acceleration(place + h / 2 * v1, v2);
      const Vector3d v3 = heading + h / 2 * a2, a3 = acceleration(place + h / 2 * v2, v3);
      const Vector3d v4 = heading + h * a3, a4 = acceleration(place + h * v3, v4);
      place += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
      heading += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    return place;
  }
};

TEST(Geodesic, OnAnEllipsoidIsAsLongAsTheWalkStraightOn) {
  const Vector3d axes(12.4, 11.3, 10.9);
  const EyeModel eye = with_retina(make_ellipsoid({axes.x(), axes.y(), -axes.z()}, 0));
  const Vector3d centre(0, 0, axes.z() - eye.axial_length_mm());
  std::mt19937 random(4);
  std::uniform_real_distribution<double> side(-0.8, 0.8), length(3, 16);
  for (int k = 0; k < 12; ++k) {
    const Vector3d towards(side(random), side(random), -1);
    Walk walk{axes, towards / std::sqrt(towards.cwiseQuotient(axes).squaredNorm()), {}};
    const Vector3d from = walk.place, normal = walk.normal(from);
    const Vector3d some(side(random), side(random), 0.3);
    walk.heading = (some - normal.dot(some) * normal).normalized();
    const double walked_mm = length(random);
    const Vector3d to = walk.after(walked_mm);
    const auto way_mm = geodesic_mm(eye, centre + from, centre + to);
    ASSERT_TRUE(way_mm);
    EXPECT_NEAR(*way_mm, walked_mm, 1e-4 * walked_mm);
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
