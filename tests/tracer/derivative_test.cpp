// Derivative images against central differences of images with the same rays.
#include <gtest/gtest.h>

#include <cmath>

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

/// The surface with its curvature matrix changed: a biconic with axis along eye x (and y where the change is
/// diagonal).
EyeModel bent(EyeModel eye, const std::string& surface, double cxx, double cyy, double qx, double qy) {
  eye.surface(surface).shape = make_biconic(1 / cxx, 1 / cyy, qx, qy, 0);
  return eye;
}

TEST(Derivatives, SpectaclePowerMatchesDifferences) {
  const Tracer tracer("");
  const auto scene = make_scene("dashes:logmar=0.6,distance_mm=3000,extent_deg=3");
  const EyeModel eye = make_eye("navarro", {});
  const TraceSettings settings = small_settings();
  // One dioptre of M, of J0 and of J45: the power matrix [[M + J0, J45], [J45, M - J0]] over the back
  // surface's 1 - n = -0.5. J0 = -C/2 cos 2a, minus cylinder with its axis along x: power S along x, S + C
  // along y.
  const double per_D = 1e-3 / (1 - 1.5);
  const Eigen::Matrix2d m = per_D * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d j0 = per_D * (Eigen::Matrix2d() << 1, 0, 0, -1).finished();
  const Eigen::Matrix2d j45 = per_D * (Eigen::Matrix2d() << 0, 1, 1, 0).finished();
  const PowerVector at{-1.5, 0.4, -0.3};
  const auto image = [&](double dm, double d0, double d45) {
    return tracer
        .trace(with_thin_lens(eye, {at.M_D + dm, at.J0_D + d0, at.J45_D + d45}, 12), *scene, settings)
        .image;
  };
  const auto result = tracer.trace(with_thin_lens(eye, at, 12), *scene, settings,
                                   {{"spectacle_back", m}, {"spectacle_back", j0}, {"spectacle_back", j45}});
  ASSERT_EQ(result.derivatives.size(), 3U);
  const double h =
      0.0005;  // the texture is bilinear: its slope has steps, whose share of the quotient falls with h
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

TEST(Derivatives, AnteriorCorneaMatchesDifferences) {
  const Tracer tracer("");
  const auto scene = make_scene("dashes:logmar=0.6,distance_mm=3000,extent_deg=3");
  EyeModel eye = make_eye("navarro", {});
  const double cx = 1 / 7.9, cy = 1 / 7.6, qx = -0.26, qy = -0.15;
  const TraceSettings settings = small_settings();
  const EyeModel here = bent(eye, "cornea_anterior", cx, cy, qx, qy);
  Eigen::Matrix2d along_x = Eigen::Matrix2d::Zero();
  along_x(0, 0) = 1e-3;
  const auto result = tracer.trace(here, *scene, settings, {{"cornea_anterior", along_x}});
  const double h = 0.001;
  const auto plus =
      tracer.trace(bent(eye, "cornea_anterior", cx + 1e-3 * h, cy, qx, qy), *scene, settings).image;
  const auto minus =
      tracer.trace(bent(eye, "cornea_anterior", cx - 1e-3 * h, cy, qx, qy), *scene, settings).image;
  const double error = relative_error(result.derivatives[0], plus, minus, h);
  std::printf("relative error against differences: %.4f\n", error);
  EXPECT_LT(error, 0.03);
}

TEST(Derivatives, SurfacesBehindTheStopAreRefused) {
  const Tracer tracer("");
  EXPECT_ANY_THROW(tracer.trace(make_eye("navarro", {}), *make_scene("point"), small_settings(),
                                {{"lens_anterior", Eigen::Matrix2d::Identity()}}));
}

}  // namespace
}  // namespace emmetrope::raytrace
