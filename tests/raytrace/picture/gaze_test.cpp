// Gaze, vergence, strabismus, spectacles under gaze, motion during the exposure.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/picture/gaze.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/exposure.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(Gaze, LooksAtItsPoint) {
  EyePose pose;
  pose.apex_mm = {-31, 0, 0};
  const Eigen::Vector3d point(20, -35, 250);
  pose.gaze = gaze_at(pose, point);
  const Eigen::Vector3d seen = pose.eye_from_scene() * point;
  EXPECT_NEAR(seen.x(), 0, 1e-9);  // on the eye's axis
  EXPECT_NEAR(seen.y(), 0, 1e-9);
  EXPECT_NEAR(seen.z() + 13.5, (point - Eigen::Vector3d(-31, 0, -13.5)).norm(), 1e-9);
  EXPECT_THROW(gaze_at(pose, {0, 0, -50}), Error);
  for (const double z : {0.3, 0.0, -5.0})
    EXPECT_THROW(gaze_at(pose, {0, 0, z}), Error) << z;  // metres, within
}

TEST(Gaze, ObeysListing) {
  // The axis of the turn from straight ahead lies in the frontal plane; a vertical line in a secondary
  // position stays vertical, in a tertiary one it is seen tilted by Helmholtz's false torsion, tan(t / 2) =
  // tan(h / 2) tan(v / 2) for Fick's h, v.
  EyePose pose;
  pose.gaze = {25, 18};
  const Eigen::AngleAxisd turn(pose.turned_from_straight().linear());
  EXPECT_NEAR(turn.axis().z(), 0, 1e-12);
  const Eigen::Matrix3d head_from_eye = pose.turned_from_straight().linear().transpose();
  const Eigen::Vector3d z = head_from_eye.col(2), up = head_from_eye.col(1);
  const double azimuth = std::atan2(z.x(), z.z()), elevation = std::asin(z.y());
  // Fick: first about the vertical, then about the eye's horizontal axis
  const Eigen::Matrix3d fick = (Eigen::AngleAxisd(azimuth, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(-elevation, Eigen::Vector3d::UnitX()))
                                   .toRotationMatrix();
  const double torsion = std::atan2(up.dot(fick.col(0)), up.dot(fick.col(1)));
  EXPECT_NEAR(std::abs(std::tan(torsion / 2)), std::tan(azimuth / 2) * std::tan(elevation / 2), 1e-12);
  EXPECT_GT(std::abs(torsion), 1 * degree);
}

TEST(Gaze, ConvergesByTheMeterAngle) {
  EyePose od, os;
  od.apex_mm.x() = -31;
  os.apex_mm.x() = 31;
  const Eigen::Vector3d point(0, 0, 400);
  const double inward = std::atan(31 / 413.5) / degree;
  EXPECT_NEAR(gaze_at(od, point).horizontal_deg, inward, 1e-9);  // the right eye turns to the patient's left
  EXPECT_NEAR(gaze_at(os, point).horizontal_deg, -inward, 1e-9);
}

TEST(Gaze, DeviatesByPrismDioptres) {
  EyePose os;
  os.apex_mm.x() = 31;
  const Eigen::Vector3d point(-40, 60, 500);
  EyePose straight = os, squint = os;
  straight.gaze = gaze_at(os, point);
  squint.gaze = gaze_at(os, point, {15, 0});  // exotropia of a left eye
  const Eigen::Vector3d a = straight.turned_from_straight().linear().transpose().col(2);
  const Eigen::Vector3d b = squint.turned_from_straight().linear().transpose().col(2);
  EXPECT_NEAR(100 * std::tan(std::acos(a.dot(b))), 15, 1e-9);
  EXPECT_GT(squint.gaze.horizontal_deg, straight.gaze.horizontal_deg + 7);
}

/// Mean place of the dark (column, row, from the middle, mm on the retina).
Eigen::Vector2d dark_centre(const LinearImage& image, double field_mm) {
  Eigen::Vector2d sum(0, 0);
  double weight = 0;
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column) {
      const double w = 1 - image.at(column, row, 1);
      sum += w * Eigen::Vector2d((column + 0.5) / image.width - 0.5, (row + 0.5) / image.height - 0.5) *
             field_mm;
      weight += w;
    }
  return sum / weight;
}

/// A black square of half a side `half` at a place of the scene.
Scene spot(const Eigen::Vector3d& at, double half) {
  Scene scene;
  TexturedPlane plane;
  plane.centre_mm = at;
  plane.right_mm = {-half, 0, 0};
  plane.up_mm = {0, half, 0};
  plane.texture = std::make_shared<const Texture>(Texture{2, 2, 1, {0, 0, 0, 0}});
  scene.planes = {plane};
  return scene;
}

TraceSettings small(double field_mm) {
  TraceSettings settings;
  settings.grid = {60, 60, field_mm, field_mm, {0, 0}};
  settings.samples = 64;
  settings.wavelength_nm = 589.3;
  settings.verbosity.quiet = true;
  return settings;
}

TEST(Exposure, SpectacleStaysWithTheHead) {
  // The line of sight of an eye that looks 20 degrees aside, traced by the host in the head's frame through
  // the lens that looks straight ahead: what lies on it is seen in the middle.
  const EyeModel eye = with_thin_lens(make_eye("navarro", {}), {-4, 0, 0}, 12);
  const Eigen::Vector3d sight = Eigen::Vector3d(std::tan(20 * degree), 0, 1).normalized();
  const Eigen::Vector3d centre(0, 0, -13.5);
  const auto end = trace_exact(eye, {centre + 14.5 / sight.z() * sight, sight}, 589.3);
  ASSERT_EQ(end.hits.size(), 2U);
  const auto& out = end.hits.back();
  // Prentice's rule with the height on the lens, to first order: it deviates by F h.
  const double prentice = std::atan(4e-3 * (12 + 13.5) * std::tan(20 * degree)) / degree;
  EXPECT_NEAR(std::atan2(out.direction.x(), out.direction.z()) / degree - 20, prentice, 0.25 * prentice);

  TraceSettings settings = small(1);
  settings.pose.gaze = {20, 0};
  const Eigen::Vector3d seen = out.position_mm + 5000 * out.direction.normalized();
  const auto image = trace_exposure(Tracer(""), eye, spot(seen, 30), settings, {}).image;
  EXPECT_NEAR(dark_centre(image, 1).x() * 3.43, 0, 0.02);  // 1 mm on the retina is 3.43 degrees
  EXPECT_NEAR(dark_centre(image, 1).y() * 3.43, 0, 0.02);
}

TEST(Exposure, BlursAlongTheMotion) {
  const EyeModel eye = make_eye("navarro", {});
  const Tracer tracer("");
  TraceSettings settings = small(1.2);
  settings.samples = 256;
  const Eigen::Vector3d at(0, 0, 6000);
  const auto spread = [&](const LinearImage& image) {  // standard deviations across and up, degrees
    const Eigen::Vector2d middle = dark_centre(image, 1.2);
    Eigen::Vector2d square(0, 0);
    double weight = 0;
    for (int row = 0; row < 60; ++row)
      for (int column = 0; column < 60; ++column) {
        const double w = 1 - image.at(column, row, 1);
        const Eigen::Vector2d d =
            Eigen::Vector2d((column + 0.5) / 60 - 0.5, (row + 0.5) / 60 - 0.5) * 1.2 - middle;
        square += w * d.cwiseProduct(d);
        weight += w;
      }
    return Eigen::Vector2d((square / weight).cwiseSqrt() * 3.43);
  };
  const Eigen::Vector2d still = spread(trace_exposure(tracer, eye, spot(at, 20), settings, {}).image);
  Exposure exposure;
  exposure.eye_motion_deg = {1, 0};
  const Eigen::Vector2d moved = spread(trace_exposure(tracer, eye, spot(at, 20), settings, exposure).image);
  // an even motion over 1 degree adds 1 / sqrt(12) in quadrature
  EXPECT_NEAR(std::sqrt(moved.x() * moved.x() - still.x() * still.x()), 1 / std::sqrt(12.0), 0.01);
  EXPECT_NEAR(moved.y(), still.y(), 0.01);

  Scene falling = spot(at, 20);
  falling.planes[0].motion_mm = {0, -6000 * std::tan(1 * degree), 0};
  const Eigen::Vector2d fell = spread(trace_exposure(tracer, eye, falling, settings, {}).image);
  EXPECT_NEAR(std::sqrt(fell.y() * fell.y() - still.y() * still.y()), 1 / std::sqrt(12.0), 0.01);
  EXPECT_NEAR(fell.x(), still.x(), 0.01);
  exposure.steps = 2000;
  EXPECT_THROW(trace_exposure(tracer, eye, falling, settings, exposure), Error);
}

TEST(TwoEyes, SeeThePointThatTheyFixateInTheMiddle) {
  const EyeModel eye = make_eye("navarro", {});
  const Tracer tracer("");
  const Eigen::Vector3d first(0, 0, 400), second(50, 10, 700);
  TraceSettings settings = small(4);
  double disparity_mm = 0;
  for (const double side : {-1.0, 1.0}) {
    settings.pose = {};
    settings.pose.apex_mm.x() = 31 * side;
    settings.pose.gaze = gaze_at(settings.pose, first);
    EXPECT_LT(dark_centre(tracer.trace(eye, spot(first, 10), settings).image, 4).norm(), 0.005);
    disparity_mm += side * dark_centre(tracer.trace(eye, spot(second, 10), settings).image, 4).x();
  }
  // Angles between both points at each centre of rotation; the further one is seen uncrossed.
  const auto angle = [&](double side, const Eigen::Vector3d& p) {
    return std::atan2(p.x() - 31 * side, p.z() + 13.5);
  };
  const double expected = (angle(-1, second) - angle(-1, first)) - (angle(1, second) - angle(1, first));
  EXPECT_LT(expected, 0);
  EXPECT_NEAR(disparity_mm * 3.43 * degree, expected, 0.05 * std::abs(expected));
}

}  // namespace
}  // namespace emmetrope::raytrace
