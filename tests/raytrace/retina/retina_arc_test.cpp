#include "raytrace/retina/retina_arc.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

EyeModel eye_with_retina(const ShapePtr& shape) {
  EyeModel eye = make_eye("navarro");
  eye.surfaces.back().shape = shape;
  return eye;
}

TEST(RetinaArc, OfASphereIsTheAngleTimesTheRadius) {
  const EyeModel eye = make_eye("navarro");
  const Vector3d centre(0, 0, -eye.axial_length_mm() + 12);
  for (const double polar_deg : {0.0, 20.0, 89.0, 91.0, 115.0}) {
    const double angle = polar_deg * degree;
    const Vector3d point =
        centre + 12 * Vector3d(0.6 * std::sin(angle), 0.8 * std::sin(angle), -std::cos(angle));
    EXPECT_NEAR(*retina_arc_mm(eye, point), 12 * angle, 1e-4) << polar_deg;
    const auto back = retina_at_arc(eye, 12 * angle * Vector2d(0.6, 0.8));
    ASSERT_TRUE(back);
    EXPECT_NEAR((back->position_mm - point).norm(), 0, 1e-4) << polar_deg;
    EXPECT_NEAR((back->normal - (centre - point) / 12).norm(), 0, 1e-5) << polar_deg;
  }
}

TEST(RetinaArc, OfAnEllipsoidIsItsMeridiansLength) {
  // Half axes 11 and 12.5 mm; the length by many chords of the ellipse's own parameter.
  const EyeModel eye = eye_with_retina(make_ellipsoid({11, 11, -12.5}, 0));
  const double pole_z_mm = -eye.axial_length_mm();
  const auto on = [&](double t) {
    return Vector3d(11 * std::sin(t), 0, pole_z_mm + 12.5 * (1 - std::cos(t)));
  };
  double length_mm = 0;
  constexpr int chords = 20000;
  const double end = 100 * degree;
  for (int k = 0; k < chords; ++k) length_mm += (on(end * (k + 1) / chords) - on(end * k / chords)).norm();
  EXPECT_NEAR(*retina_arc_mm(eye, on(end)), length_mm, 1e-4);
  EXPECT_NEAR((retina_at_arc(eye, {length_mm, 0})->position_mm - on(end)).norm(), 0, 1e-4);
}

TEST(RetinaArc, EndsWhereTheRetinaEnds) {
  EyeModel eye = make_eye("navarro");
  eye.surfaces.back().semi_diameter_mm = 10;
  EXPECT_TRUE(retina_at_arc(eye, {12 * std::asin(0.8), 0}));
  EXPECT_FALSE(retina_at_arc(eye, {12 * std::asin(0.9), 0}));
  EXPECT_FALSE(retina_at_arc(eye, {12 * (pi - std::asin(0.8)), 0}));  // in front of the equator
}

}  // namespace
}  // namespace emmetrope::raytrace
