// Derivative images against central differences of images with the same rays.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "pipeline/base/error.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

TraceSettings small_settings() {
  TraceSettings settings;
  settings.grid = {48, 48, 0.6, 0.6, {0, 0}};
  settings.samples = 512;
  settings.verbosity.quiet = true;
  settings.wavelength_nm = 555;
  return settings;
}

/// Largest share that the derivative and the difference quotient do not have in common: |a - b| / |b| over
/// the image.
double relative_error(const LinearImage& derivative, const LinearImage& plus, const LinearImage& minus,
                      double step) {
  double error = 0, size = 0;
  for (std::size_t i = 0; i < derivative.values.size(); ++i) {
    const double quotient = (double(plus.values[i]) - minus.values[i]) / (2 * step);
    error += std::pow(derivative.values[i] - quotient, 2);
    size += quotient * quotient;
  }
  return std::sqrt(error / size);
}

/// The derivative image by a parameter against the difference quotient of two images close by.
/// \param eye_at  the eye with the parameter so much above where it is wanted
/// \param step  of the eyes that the derivative is made from; the images' is a thousandth: the texture is
///   bilinear, its slope has steps, whose share of the quotient falls with it
double error_against_differences(const std::function<EyeModel(double)>& eye_at, double step,
                                 const Scene& scene, const TraceSettings& settings) {
  const Tracer tracer("");
  const auto result = tracer.trace(eye_at(0), scene, settings, {{eye_at(step), eye_at(-step), 2 * step}});
  const double h = step / 1000;
  const auto plus = tracer.trace(eye_at(h), scene, settings).image,
             minus = tracer.trace(eye_at(-h), scene, settings).image;
  return relative_error(result.derivatives.at(0), plus, minus, h);
}

TEST(Derivatives, SpectaclePowerMatchesDifferences) {
  const Tracer tracer("");
  const auto scene = make_scene("dashes:logmar=0.6,distance_mm=3000,extent_deg=3");
  const EyeModel eye = make_eye("navarro", {});
  const TraceSettings settings = small_settings();
  const PowerVector at{-1.5, 0.4, -0.3};
  const auto glasses = [&](double dm, double d0, double d45) {
    return with_thin_lens(eye, {at.M_D + dm, at.J0_D + d0, at.J45_D + d45}, 12);
  };
  const auto image = [&](double dm, double d0, double d45) {
    return tracer.trace(glasses(dm, d0, d45), *scene, settings).image;
  };
  const double s = 0.1;
  const auto result = tracer.trace(glasses(0, 0, 0), *scene, settings,
                                   {{glasses(s, 0, 0), glasses(-s, 0, 0), 2 * s},
                                    {glasses(0, s, 0), glasses(0, -s, 0), 2 * s},
                                    {glasses(0, 0, s), glasses(0, 0, -s), 2 * s}});
  ASSERT_EQ(result.derivatives.size(), 3U);
  const double h = 0.0005;
  const double errors[] = {relative_error(result.derivatives[0], image(h, 0, 0), image(-h, 0, 0), h),
                           relative_error(result.derivatives[1], image(0, h, 0), image(0, -h, 0), h),
                           relative_error(result.derivatives[2], image(0, 0, h), image(0, 0, -h), h)};
  std::printf("relative errors against differences: M %.4f J0 %.4f J45 %.4f\n", errors[0], errors[1],
              errors[2]);
  for (const double error : errors) EXPECT_LT(error, 0.02);
  // The image itself is the same with and without derivatives.
  const auto plain = image(0, 0, 0);
  for (std::size_t i = 0; i < plain.values.size(); ++i)
    EXPECT_NEAR(plain.values[i], result.image.values[i], 2e-4);
}

struct Parameter {
  const char* name;
  double step;
  void (*add)(EyeModel& eye, double amount);
};
class EyeParameters : public testing::TestWithParam<Parameter> {};

TEST_P(EyeParameters, MatchDifferences) {
  const Parameter& parameter = GetParam();
  const auto scene = make_scene("dashes:logmar=0.6,distance_mm=3000,extent_deg=3");
  const auto eye_at = [&](double amount) {
    EyeModel eye = make_eye("navarro", {0, {}, 4.0});
    parameter.add(eye, amount);
    return eye;
  };
  const double error = error_against_differences(eye_at, parameter.step, *scene, small_settings());
  std::printf("%s: relative error against differences %.4f\n", parameter.name, error);
  EXPECT_LT(error, 0.03);
}
INSTANTIATE_TEST_SUITE_P(
    FrontAndBack, EyeParameters,
    testing::Values(
        Parameter{"flat meridian of a toric cornea", 0.1,
                  [](EyeModel& eye, double mm) {
                    eye.surface("cornea_anterior").shape = make_biconic(7.9 + mm, 7.6, -0.26, -0.15, 0);
                  }},
        Parameter{"asphericity of the cornea", 0.1,
                  [](EyeModel& eye, double q) {
                    eye.surface("cornea_anterior").shape = make_conic(7.72, -0.26 + q);
                  }},
        Parameter{
            "back of the lens", 0.1,
            [](EyeModel& eye, double mm) { eye.surface("lens_posterior").shape = make_conic(-6 + mm, -1); }},
        Parameter{"lens thickness", 0.1,
                  [](EyeModel& eye, double mm) { eye.surface("lens_posterior").position_mm += mm; }},
        Parameter{"tilt of the lens's back", 0.5,
                  [](EyeModel& eye, double deg) { eye.surface("lens_posterior").tilt_deg.x() += deg; }},
        Parameter{"index of the lens", 0.002,
                  [](EyeModel& eye, double by) { eye.media.at("lens").index += by; }},
        Parameter{"length of the eye", 0.1,
                  [](EyeModel& eye, double mm) { eye.surfaces.back().position_mm += mm; }}));

TEST(Derivatives, EveryWayAndColourDrawsTheSame) {
  // Smooth meshes (in tiles), the fast map, and rays one by one against formulas; all wavelengths against
  // differences.
  const auto scene = make_scene("dashes:logmar=0.6,distance_mm=3000,extent_deg=3");
  const EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  const auto longer = [&](double mm) {
    EyeModel result = eye;
    result.surfaces.back().position_mm += mm;
    return result;
  };
  TraceSettings settings = small_settings();
  settings.samples = 1024;
  const std::vector<EyeTangent> by_length{{longer(0.1), longer(-0.1), 0.2}};
  const auto formulas = Tracer("").trace(eye, *scene, settings, by_length).derivatives.at(0);
  double size = 0;
  for (const float value : formulas.values) size += value * value;
  const auto departure = [&](const LinearImage& other) {
    double sum = 0;
    for (std::size_t i = 0; i < other.values.size(); ++i)
      sum += std::pow(other.values[i] - formulas.values[i], 2);
    return std::sqrt(sum / size);
  };
  const double one_by_one =
      departure(Tracer("", 0, 1).trace(eye, *scene, settings, by_length).derivatives.at(0));
  settings.representation = Representation::fast;
  const double fast = departure(Tracer("").trace(eye, *scene, settings, by_length).derivatives.at(0));
  settings.representation = Representation::smooth;
  const double smooth = departure(Tracer("").trace(eye, *scene, settings, by_length).derivatives.at(0));
  settings.representation = Representation::analytic;
  settings.seed = 2;
  const double noise = departure(Tracer("").trace(eye, *scene, settings, by_length).derivatives.at(0));
  std::printf("against formulas: rays one by one %.4f, fast %.4f, smooth %.4f, other rays %.4f\n", one_by_one,
              fast, smooth, noise);
  EXPECT_LT(one_by_one, 0.01);
  EXPECT_LT(fast, 0.01);
  EXPECT_LT(smooth, 1.2 * noise);  // tiles have other places in the pupil

  settings = small_settings();
  settings.wavelength_nm.reset();
  const double spectral = error_against_differences(longer, 0.1, *scene, settings);
  std::printf("all wavelengths: relative error against differences %.4f\n", spectral);
  EXPECT_LT(spectral, 0.03);
}

// Of six faces around the eye it sees one; the others are edge on, or behind it.
TEST(Derivatives, OfSurroundingsMatchDifferences) {
  const EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  const auto longer = [&](double mm) {
    EyeModel result = eye;
    result.surfaces.back().position_mm += mm;
    return result;
  };
  TraceSettings settings = small_settings();
  settings.grid.field_x_mm = settings.grid.field_y_mm = 3;  // spokes begin 2 degrees off the middle
  const double error = error_against_differences(longer, 0.1, *make_scene("perimeter"), settings);
  std::printf("surroundings: relative error against differences %.4f\n", error);
  EXPECT_LT(error, 0.03);
}

// A wall that recedes from 4.8 to 3.6 degrees aside and would, longer, pass edge on through the middle of the field,
// where its coordinates have a pole: what polynomials make of it is a hundred thousand times any change.
TEST(Derivatives, PolynomialsOfAPlaneThatFewRaysMeetAreCheckedToo) {
  const EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  EyeModel ahead = eye, behind = eye;
  ahead.surfaces.back().position_mm += 0.1;
  behind.surfaces.back().position_mm -= 0.1;
  TraceSettings settings = small_settings();
  settings.grid.field_x_mm = settings.grid.field_y_mm = 3;
  const auto largest_beside_a_wall = [&](double half_height) {
    Scene scene = *make_scene("dashes:logmar=0.6,distance_mm=inf");
    TexturedPlane wall = scene.planes.front();
    wall.centre_mm = {0.05, 0.01, 0.7};
    wall.right_mm = {0, 0, 0.1};
    wall.up_mm = {0, half_height, 0};
    scene.planes.insert(scene.planes.begin(), wall);
    const auto traced = Tracer("").trace(eye, scene, settings, {{ahead, behind, 0.2}});
    float largest = 0;
    for (const float value : traced.derivatives.at(0).values) largest = std::max(largest, std::abs(value));
    return largest;
  };
  try {
    largest_beside_a_wall(0.002);  // 0.4 % of the rays fall on it
    ADD_FAILURE() << "were accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::unsupported) << error.what();
  }
  EXPECT_LT(largest_beside_a_wall(1e-5), 10);  // some tens of rays in a million
}

TEST(Derivatives, PolynomialsThatMissExactRaysAreRefused) {
  // At full accommodation and with a wide pupil rays pass beside Gullstrand's nucleus: no smooth change.
  const EyeModel eye = make_eye("gullstrand", {10.87, {}, 6.0});
  EyeModel ahead = eye, behind = eye;
  ahead.surface("lens_posterior").position_mm += 0.01;
  behind.surface("lens_posterior").position_mm -= 0.01;
  TraceSettings settings = small_settings();
  settings.grid = {16, 16, 6, 6, {0, 0}};
  EXPECT_THROW(Tracer("").trace(eye, *make_scene("letters"), settings, {{ahead, behind, 0.02}}), Error);
}

}  // namespace
}  // namespace emmetrope::raytrace
