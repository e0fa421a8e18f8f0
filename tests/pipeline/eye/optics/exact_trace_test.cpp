#include "pipeline/eye/optics/exact_trace.hpp"

#include <gmock/gmock.h>

#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope {
namespace {

EyeModel open_eye(const std::string& name) {
  EyeOptions options;
  options.pupil_mm = 20;
  return make_eye(name, options);
}

TEST(ExactTrace, RaysRunBackTheWayTheyCame) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-2, 2);
  for (const std::string& name : schematic_eye_names()) {
    const EyeModel eye = open_eye(name);
    const ExactTracer tracer(eye, 520);
    for (int k = 0; k < 20; ++k) {
      const Ray in{{place(random), place(random), 12},
                   Eigen::Vector3d(place(random) / 30, place(random) / 30, -1).normalized()};
      const RayPath path = tracer.trace(in);
      ASSERT_EQ(path.state, RayState::reached) << name;
      EXPECT_EQ(path.at, "retina");
      const RayPath back = tracer.trace({path.hits.back().position_mm, -path.hits.back().direction});
      ASSERT_EQ(back.state, RayState::reached) << name;
      EXPECT_EQ(back.at, "cornea_anterior");
      EXPECT_LT((back.hits.back().direction + in.direction).norm(), 1e-9) << name;
      EXPECT_LT((back.hits.back().position_mm - path.hits.front().position_mm).norm(), 1e-8) << name;
      const double outside = (path.hits.front().position_mm - in.origin).norm();
      EXPECT_NEAR(back.hits.back().opl_mm + outside, path.hits.back().opl_mm, 1e-8) << name;
    }
  }
}

TEST(ExactTrace, GradientStepIsSmallEnough) {
  for (const char* name : {"liou-brennan", "atchison:-4"}) {
    const EyeModel eye = open_eye(name);
    for (const double height : {0.5, 1.5, 2.5}) {
      const Ray ray{{height, 0.3, 10}, Eigen::Vector3d(-0.05, 0.08, -1).normalized()};
      const RayPath coarse = trace_exact(eye, ray, 555), fine = trace_exact(eye, ray, 555, 0.005);
      EXPECT_LT((coarse.hits.back().position_mm - fine.hits.back().position_mm).norm(), 1e-9) << name;
      EXPECT_NEAR(coarse.hits.back().opl_mm, fine.hits.back().opl_mm, 1e-9) << name;
    }
  }
}

TEST(ExactTrace, SkewRaysOfARotationalGradientKeepTheirInvariant) {
  // n (x q - y p) is constant along a ray of a rotationally symmetric system.
  const EyeModel eye = open_eye("liou-brennan");
  const RayPath path = trace_exact(eye, {{1.2, -0.7, 10}, Eigen::Vector3d(0.06, 0.11, -1).normalized()}, 555);
  const auto moment = [](const RayHit& hit) {
    return hit.position_mm.x() * hit.direction.y() - hit.position_mm.y() * hit.direction.x();
  };
  EXPECT_NEAR(moment(path.hits.back()) * 1.336,
              (1.2 * 0.11 + 0.7 * 0.06) / std::sqrt(1 + 0.06 * 0.06 + 0.11 * 0.11), 1e-9);
}

TEST(ExactTrace, FermatsPathIsStationary) {
  // Moving the hit on one surface changes the optical path in second order only.
  const EyeModel eye = open_eye("navarro");
  const RayPath path = trace_exact(eye, {{1.5, 0.8, 10}, {0, 0, -1}}, 589.3);
  const Eigen::Vector3d before = path.hits[0].position_mm, after = path.hits[2].position_mm;
  const Shape& shape = *eye.surface("cornea_posterior").shape;
  const auto length = [&](double dx, double dy) {
    const double x = path.hits[1].position_mm.x() + dx, y = path.hits[1].position_mm.y() + dy;
    const Eigen::Vector3d p(x, y, -0.55 - *shape.depth_mm(x, y));
    return 1.376 * (p - before).norm() + 1.3374 * (after - p).norm();
  };
  constexpr double h = 1e-4;
  EXPECT_NEAR((length(h, 0) - length(-h, 0)) / (2 * h), 0, 1e-8);
  EXPECT_NEAR((length(0, h) - length(0, -h)) / (2 * h), 0, 1e-8);
}

TEST(ExactTrace, RaysNearTheAxisAreParaxial) {
  for (const std::string& name : schematic_eye_names()) {
    const EyeModel eye = open_eye(name);
    const double nm = eye.reference_wavelength_nm;
    const RayPath path = trace_exact(eye, {{0, 1e-3, 10}, {0, 0, -1}}, nm);
    const RayHit& last = path.hits.at(path.hits.size() - 2);
    const double crossing =
        -(last.position_mm.z() - last.position_mm.y() * last.direction.z() / last.direction.y());
    EXPECT_NEAR(crossing, cardinal_points(eye, nm).image_focal_mm, 1e-5) << name;
  }
}

TEST(ExactTrace, StatesSayWhereARayEnded) {
  EyeModel eye = make_eye("gullstrand");
  RayPath path = trace_exact(eye, {{0, 3.5, 10}, {0, 0, -1}}, 589.3);
  EXPECT_EQ(path.state, RayState::vignetted);
  EXPECT_EQ(path.at, "iris");
  path = trace_exact(eye, {{0, 9, 10}, {0, 0, -1}}, 589.3);
  EXPECT_EQ(path.state, RayState::missed_surface);
  EXPECT_EQ(path.at, "cornea_anterior");
  EXPECT_TRUE(path.hits.empty());
  eye.surface("cornea_anterior").semi_diameter_mm = 3;
  EXPECT_EQ(trace_exact(eye, {{0, 3.2, 10}, {0, 0, -1}}, 589.3).state, RayState::missed_surface);
  // From the chamber outward, on the cornea's inside beyond the critical angle of 48.5 degrees.
  eye = open_eye("bennett-rabbetts");
  path = trace_exact(eye, {{0, -4, -2.5}, Eigen::Vector3d(0, 0.866, 0.5).normalized()}, 589.3);
  EXPECT_EQ(path.state, RayState::tir);
  EXPECT_EQ(path.at, "cornea_anterior");
}

TEST(ExactTrace, LensThatIsMissedIsNotPassedThrough) {
  // The accommodated lens ends 4.16 mm off its axis; the media on its two sides differ, so that it may not be
  // skipped.
  EyeOptions options;
  options.accommodation_parameter = 10.87013;
  options.pupil_mm = 20;
  const EyeModel eye = make_eye("gullstrand", options);
  EXPECT_EQ(trace_exact(eye, {{5.3, 0, 10}, {0, 0, -1}}, 589.3).state, RayState::missed_surface);
}

TEST(ExactTrace, TiltIsFirstAboutXThenAboutTheFixedY) {
  EyeModel eye = open_eye("navarro");
  Surface& lens = eye.surface("lens_anterior");
  lens.decentre_mm = {0.3, -0.2};
  lens.tilt_deg = {4, 7};
  const double a = 4 * degree, b = 7 * degree;
  Eigen::Matrix3d about_x, about_y;
  about_x << 1, 0, 0, 0, std::cos(a), -std::sin(a), 0, std::sin(a), std::cos(a);
  about_y << std::cos(b), 0, std::sin(b), 0, 1, 0, -std::sin(b), 0, std::cos(b);
  EXPECT_LT((lens.eye_from_surface().linear() - about_y * about_x).norm(), 1e-14);
  EXPECT_LT((lens.eye_from_surface().translation() - Eigen::Vector3d(0.3, -0.2, -3.6)).norm(), 1e-14);
  const RayPath path = trace_exact(eye, {{0.5, 0.4, 10}, {0, 0, -1}}, 589.3);
  const Eigen::Vector3d p = lens.eye_from_surface().inverse() * path.hits[2].position_mm;
  EXPECT_NEAR(-p.z(), *lens.shape->depth_mm(p.x(), p.y()), 1e-12);
  EXPECT_EQ(eye.surface("lens_posterior").eye_from_surface().translation().z(),
            -7.6);  // nothing carries over
}

TEST(ExactTrace, AThinLensMayCrossItself) {
  // Front and back of +5 D with no thickness between: off the axis the back lies in front of the front.
  EyeModel eye = open_eye("navarro");
  eye.media["glass"].index = 1.5;
  Surface front, back;
  front.name = "front";
  front.shape = make_plane();
  front.position_mm = -12;
  front.medium_after = "glass";
  back = front;
  back.name = "back";
  back.shape = make_sphere(-100);
  back.medium_after = "air";
  eye.surfaces.insert(eye.surfaces.begin(), {front, back});
  const RayPath path = trace_exact(eye, {{0, 2, 30}, {0, 0, -1}}, 589.3);
  ASSERT_EQ(path.state, RayState::reached);
  EXPECT_NEAR(path.hits[1].direction.y() / path.hits[1].direction.z(), 2 * 5e-3, 1e-5);
}

// Deeper than the apex, but not behind the cornea, which ends nearer to the axis.
TEST(ExactTrace, ARayFromBesideTheEyeMeetsTheCornea) {
  const EyeModel eye = make_eye("navarro");
  for (const Eigen::Vector3d& from : {Eigen::Vector3d(-25.043894, 0, -0.121285), Eigen::Vector3d(0, 20, -1),
                                      Eigen::Vector3d(15, 15, -0.5)}) {
    const Eigen::Vector3d to =
        -5.12 * Eigen::Vector3d(-from.x(), -from.y(), 0).normalized() + Eigen::Vector3d(0, 0, -1.8644);
    const RayPath path = trace_exact(eye, {from, (to - from).normalized()}, eye.reference_wavelength_nm);
    ASSERT_FALSE(path.hits.empty());
    EXPECT_EQ(path.hits.front().surface, "cornea_anterior");
    const Eigen::Vector3d& at = path.hits.front().position_mm;
    EXPECT_NEAR((at - from).cross((to - from).normalized()).norm(), 0, 1e-9);
    // r^2 = 2 R d - (1 + Q) d^2
    EXPECT_NEAR(at.head<2>().squaredNorm(), 2 * 7.72 * -at.z() - 0.74 * at.z() * at.z(), 1e-8);
  }
}

TEST(ExactTrace, ARayMayStartInsideTheEye) {
  const EyeModel eye = open_eye("gullstrand");
  const RayPath inward = trace_exact(eye, {{0, 0.5, -3}, {0, 0, -1}}, 589.3);
  EXPECT_EQ(inward.hits.front().surface, "lens_anterior");
  const RayPath outward = trace_exact(eye, {{0, 0.5, -3}, {0, 0, 1}}, 589.3);
  EXPECT_EQ(outward.hits.front().surface, "cornea_posterior");
  EXPECT_EQ(outward.hits.size(), 2u);
  EXPECT_NEAR(outward.hits.front().opl_mm, 1.336 * (3 + outward.hits.front().position_mm.z()), 1e-9);
}

}  // namespace
}  // namespace emmetrope
