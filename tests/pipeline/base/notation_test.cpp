#include "pipeline/base/notation.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"

namespace emmetrope {
namespace {

PowerVector random_refraction(std::mt19937_64& random) {
  std::uniform_real_distribution<double> sphere(-12, 8), cylinder(-5, 0), axis(0, 180);
  return to_power_vector({sphere(random), cylinder(random), axis(random)});
}

TEST(Notation, WritesAsPrescribed) {
  EXPECT_EQ(format_refraction({-2.25, -1, 180}), "-2.25 / -1.00 x 180");
  EXPECT_EQ(format_refraction({-2.25, -1, 0}), "-2.25 / -1.00 x 180");
  EXPECT_EQ(format_refraction({0, -0.75, 5}), "0.00 / -0.75 x 005");
  EXPECT_EQ(format_refraction({-0.001, -0.75, 179.6}), "0.00 / -0.75 x 180");
  // A cylinder that is not written leaves its mean in the sphere, in either notation.
  EXPECT_EQ(format_refraction({1.5, -0.1, 33}), "+1.45 DS");
  EXPECT_EQ(format_plus_cylinder({1.5, -0.1, 33}), "+1.45 DS");
  EXPECT_EQ(format_refraction({-3.25, 1, 90}), "-2.25 / -1.00 x 180");
  EXPECT_EQ(format_plus_cylinder({-2.25, -1, 180}), "-3.25 / +1.00 x 090");
}

TEST(Notation, ZeroHasNoSign) {
  EXPECT_EQ(fmt::format("{:.2f}", without_negative_zero(-0.0049, 2)), "0.00");
  EXPECT_EQ(fmt::format("{:+.4f}", without_negative_zero(-0.0, 4)), "+0.0000");
  EXPECT_EQ(fmt::format("{:.2f}", without_negative_zero(-0.0051, 2)), "-0.01");
}

TEST(Notation, TranspositionIsTheSameLens) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 200; ++i) {
    const PowerVector power = random_refraction(random);
    const SpheroCylinder minus = to_sphero_cylinder(power), plus = transpose(minus);
    EXPECT_LE(minus.cylinder_D, 0);
    EXPECT_GE(plus.cylinder_D, 0);
    EXPECT_LT(distance_D(to_power_vector(plus), power), 1e-12);
    EXPECT_NEAR(transpose(plus).axis_deg, minus.axis_deg, 1e-9);
  }
}

TEST(Notation, RoundingIsTheNearestOfAll) {
  std::mt19937_64 random(4);
  for (int i = 0; i < 60; ++i) {
    const PowerVector power = random_refraction(random);
    const RoundedRefraction rounded = round_refraction(power);
    double nearest_D = INFINITY;
    for (int s = -80; s <= 60; ++s)
      for (int c = 0; c <= 26; ++c)
        for (int a = 5; a <= 180; a += 5)
          nearest_D =
              std::min(nearest_D, distance_D(power, to_power_vector({0.25 * s, -0.25 * c, double(a)})));
    EXPECT_NEAR(rounded.residual_D, nearest_D, 1e-9);
    EXPECT_NEAR(distance_D(to_power_vector(rounded.refraction), power), nearest_D, 1e-9);
    EXPECT_GE(rounded.refraction.axis_deg, 5);
    EXPECT_LE(rounded.refraction.axis_deg, 180);
  }
}

TEST(Notation, RoundingOneByOneIsWorse) {
  // M = -2.87: rounding S = -2.37 and C = -1.00 apart leaves 0.12 D of M too much.
  const PowerVector power = to_power_vector({-2.38, -1.12, 180});
  const RoundedRefraction rounded = round_refraction(power);
  EXPECT_LE(rounded.residual_D, distance_D(power, to_power_vector({-2.5, -1.0, 180})));
  const RoundedRefraction sphere = round_refraction({-1.02, 0.01, 0.02});
  EXPECT_EQ(sphere.refraction.cylinder_D, 0);
  EXPECT_EQ(sphere.refraction.axis_deg, 180);
  EXPECT_EQ(format_refraction(sphere.refraction), "-1.00 DS");
}

TEST(Notation, VertexConversionOfKnownLenses) {
  EXPECT_NEAR(move_towards_eye({-10, 0, 0}, 12).M_D, -8.9286, 5e-5);
  EXPECT_NEAR(move_towards_eye({10, 0, 0}, 12).M_D, 11.3636, 5e-5);
  EXPECT_NEAR(move_towards_eye({-4, 0, 0}, 12).M_D, -3.8168, 5e-5);
  // A cylinder's two meridians move apart, each by the same rule.
  const SpheroCylinder moved = to_sphero_cylinder(move_towards_eye(to_power_vector({-4, -6, 30}), 12));
  EXPECT_NEAR(moved.sphere_D, -4 / 1.048, 1e-9);
  EXPECT_NEAR(moved.sphere_D + moved.cylinder_D, -10 / 1.12, 1e-9);
  EXPECT_NEAR(moved.axis_deg, 30, 1e-9);
}

TEST(Notation, ReadsWhatPeopleType) {
  const StatedRefraction full = parse_refraction("-2.25/-1.00x180@14+-0.25");
  EXPECT_EQ(full.refraction.sphere_D, -2.25);
  EXPECT_EQ(full.refraction.cylinder_D, -1);
  EXPECT_EQ(full.refraction.axis_deg, 0);
  EXPECT_EQ(full.vertex_distance_mm, 14);
  EXPECT_EQ(full.sigma_D, 0.25);
  const StatedRefraction plus = parse_refraction("+1.00 / +0.50 x 90");
  EXPECT_EQ(plus.refraction.sphere_D, 1.5);
  EXPECT_EQ(plus.refraction.cylinder_D, -0.5);
  EXPECT_EQ(plus.refraction.axis_deg, 0);
  EXPECT_EQ(plus.vertex_distance_mm, 12);
  for (const char* plano : {"PL", "pl", "plano", "Plano DS"})
    EXPECT_EQ(parse_refraction(plano).refraction.sphere_D, 0) << plano;
  EXPECT_EQ(parse_refraction("-2.25/-1.00X175").refraction.axis_deg, 175);
  EXPECT_EQ(parse_refraction("-3").refraction.sphere_D, -3);
  EXPECT_EQ(parse_refraction(format_refraction({-3, 0, 0}) + " @ 14").vertex_distance_mm, 14);
  EXPECT_EQ(parse_refraction(format_refraction({-7.5, -2.25, 45})).refraction.axis_deg, 45);
}

TEST(Notation, RefusesWhatIsNoRefraction) {
  EXPECT_EQ(parse_refraction("-2@0").vertex_distance_mm, 0);  // of a contact lens
  for (const char* text : {"",          "abc",    "-2/",      "-2/-1",        "-2/-1x",           "-2/-1x181",
                           "-2/-1x-5",  "-2@99",  "-2@0.012", "+225/-100x10", "+1/-22x90",        "-2+-0",
                           "-2+-0.009", "-2+--1", "+-0.25",   "-2/+-0.25x90", "-2/-1x90@12extra", "nan",
                           "inf",       "1e999"}) {
    try {
      parse_refraction(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage) << text;
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos);
      EXPECT_FALSE(error.remedy().empty());
    }
  }
}

TEST(Notation, SaysWhichNumberNobodyHas) {
  for (const auto& [text, what] : {std::pair("-60", "that sphere"),
                                   {"+1/-22x90", "that cylinder"},
                                   {"-2/-1x230", "that axis"},
                                   {"-2@0.012", "that vertex distance"},
                                   {"-2+-9", "that accuracy"}})
    try {
      parse_refraction(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()), "refraction \"" + std::string(text) + "\": nobody has " + what);
    }
}

TEST(Notation, ARefractionOfAnEyeSaysWhich) {
  EXPECT_EQ(parse_eye_refraction("os:-2/-1x30").eye, Laterality::os);
  EXPECT_EQ(parse_eye_refraction("od:-2/-1x30").stated.refraction.axis_deg, 30);
  for (const char* text : {"-2", "right:-2", "od-2", ":-2"}) EXPECT_THROW(parse_eye_refraction(text), Error);
}

}  // namespace
}  // namespace emmetrope
