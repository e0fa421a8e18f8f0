#include "pipeline/eye/parametric/parametric_eye.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/surfaces/shape.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope {
namespace {

using Eigen::Vector3d;

TEST(ParametricEye, CorneaIsAConicInItsPrincipalMeridians) {
  ParametricEye eye;
  const double axis = 30 * degree, c = 1 / 7.8, j = 0.004;
  eye.cornea_c_per_mm = c;
  eye.cornea_j0_per_mm = j * std::cos(2 * axis);
  eye.cornea_j45_per_mm = j * std::sin(2 * axis);
  eye.cornea_q = -0.3;
  eye.cornea_q_split = 0.1;
  const ParametricEye::Biconic biconic = eye.cornea_biconic();
  EXPECT_NEAR(biconic.steep_axis_deg, 30, 1e-9);
  // A cylinder of 2.7 D is far above the scale at which the split fades.
  EXPECT_NEAR(biconic.steep_q, -0.2, 0.002);
  EXPECT_NEAR(biconic.flat_q, -0.4, 0.002);
  for (const auto& [meridian, curvature, q] :
       {std::tuple{axis, c + j, biconic.steep_q}, std::tuple{axis + pi / 2, c - j, biconic.flat_q}}) {
    const double r = 3, R = 1 / curvature;
    const double conic = r * r / (R * (1 + std::sqrt(1 - (1 + q) * r * r / (R * R))));
    EXPECT_NEAR(eye.cornea_anterior_depth_mm(r * std::cos(meridian), r * std::sin(meridian)), conic, 1e-12);
  }
  EXPECT_DOUBLE_EQ(eye.cornea_posterior_depth_mm(0, 0), eye.cornea_thickness_mm);
}

/// Between the meridians too: the eye's own formula against the biconic of the ray tracer.
TEST(ParametricEye, CorneaIsTheTracersBiconic) {
  ParametricEye eye = random_eye(5);
  eye.cornea_q_split = -0.07;
  const ParametricEye::Biconic b = eye.cornea_biconic();
  const ShapePtr shape =
      make_biconic(b.steep_radius_mm, b.flat_radius_mm, b.steep_q, b.flat_q, b.steep_axis_deg);
  for (int i = 0; i < 40; ++i) {
    const double r = 0.1 * i, azimuth = 0.7 * i, x = r * std::cos(azimuth), y = r * std::sin(azimuth);
    EXPECT_NEAR(eye.cornea_anterior_depth_mm(x, y), shape->depth_mm(x, y).value(), 1e-12);
  }
  eye.cornea_j0_per_mm = eye.cornea_j45_per_mm = 0;
  EXPECT_EQ(eye.cornea_biconic().steep_q, eye.cornea_biconic().flat_q);
}

TEST(ParametricEye, PoleIsWhereTheDisplacementPutsIt) {
  ParametricEye eye;
  EXPECT_DOUBLE_EQ(eye.pole_depth_mm(), eye.axial_length_mm);
  eye.displacement_directions = {-Vector3d::UnitZ(), Vector3d::UnitX()};
  eye.displacement_mm = {0.22, 0.1};
  const double quarter = pi / 2 / eye.displacement_width_rad;
  const double u = 0.22 + 0.1 * std::exp(-quarter * quarter / 2);
  EXPECT_NEAR(eye.pole_depth_mm(), eye.axial_length_mm + u * eye.globe_semi_axes_mm.z() / 11, 1e-12);
}

TEST(ParametricEye, RetinaNormalIsPerpendicularToItsTangents) {
  const ParametricEye eye = random_eye(3);
  for (int i = 0; i < 50; ++i) {
    const double polar = 0.04 * i, azimuth = 1.7 * i, h = 1e-5;
    const auto n = [&](double p, double a) {
      return Vector3d(std::sin(p) * std::cos(a), std::sin(p) * std::sin(a), -std::cos(p));
    };
    const Vector3d normal = eye.retina_normal(n(polar, azimuth));
    const Vector3d along = eye.retina_point(n(polar + h, azimuth)) - eye.retina_point(n(polar - h, azimuth));
    const Vector3d across = eye.retina_point(n(polar, azimuth + h)) - eye.retina_point(n(polar, azimuth - h));
    EXPECT_NEAR(normal.norm(), 1, 1e-12);
    EXPECT_NEAR(normal.dot(along.normalized()), 0, 1e-7);
    if (i > 0) {
      EXPECT_NEAR(normal.dot(across.normalized()), 0, 1e-7);
    }
    EXPECT_GT(normal.dot(eye.globe_centre_mm() - eye.retina_point(n(polar, azimuth))), 0);
  }
}

TEST(ParametricEye, EveryNamedParameterReadsBackWhatWasSet) {
  ParametricEye eye = random_eye(5);
  for (const std::string& name : eye.parameter_names) {
    const double value = eye.get(name) + 0.01;
    eye.set(name, value);
    EXPECT_NEAR(eye.get(name), value, 1e-9) << name;
  }
  EXPECT_THROW(eye.get("cornea_radius"), Error);
  EXPECT_THROW(eye.set("displacement_900_mm", 1), Error);
}

TEST(ParametricEye, GazeTurnsAboutTheApexAndKeepsXHorizontal) {
  ParametricEye eye = random_eye(6);
  const Vector3d apex = eye.lps_from_eye.translation();
  eye.set("gaze_horizontal_deg", 20);
  eye.set("gaze_vertical_deg", -10);
  const Vector3d axis = eye.lps_from_eye.linear().col(2);
  EXPECT_NEAR(axis.x(), std::sin(20 * degree) * std::cos(10 * degree), 1e-12);  // towards the patient's left
  EXPECT_NEAR(axis.z(), -std::sin(10 * degree), 1e-12);                         // down
  EXPECT_NEAR(eye.lps_from_eye.linear()(2, 0), 0, 1e-12);
  EXPECT_EQ(eye.lps_from_eye.translation(), apex);
}

TEST(ParametricEye, JsonRoundTripKeepsEveryNumber) {
  const ParametricEye eye = random_eye(7);
  const Json json = to_json(eye);
  const ParametricEye back = parametric_eye_from_json(Json::parse(json.dump()));
  EXPECT_EQ(to_json(back), json);
  EXPECT_EQ(back.covariance, eye.covariance);
  EXPECT_EQ(back.source, eye.source);
  EXPECT_EQ(back.displacement_directions, eye.displacement_directions);
}

TEST(ParametricEye, BrokenJsonIsRefusedWithTheKey) {
  const auto message = [](const Json& json) -> std::string {
    try {
      parametric_eye_from_json(json);
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::input_invalid);
      return error.what();
    }
    return "accepted";
  };
  const Json good = to_json(random_eye(8));
  for (const char* key : {"laterality", "cornea_q", "globe_semi_axes_mm", "covariance", "displacement_mm"}) {
    Json broken = good;
    broken.erase(key);
    EXPECT_NE(message(broken).find(key), std::string::npos) << key;
    broken[key] = "x";
    EXPECT_NE(message(broken).find(key), std::string::npos) << key;
  }
  Json unknown = good;
  unknown["parameters"][0]["name"] = "lid_thickness_mm";
  EXPECT_NE(message(unknown).find("lid_thickness_mm"), std::string::npos);
}

}  // namespace
}  // namespace emmetrope
