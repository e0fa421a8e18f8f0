#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <memory>

#include "correction/search/retinal_sharpness.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"

/// How a correcting lens stretches the picture on the retina, against the closed form.
namespace emmetrope::correction {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double off_axis_deg = 0.7;

/// Four soft spots on black at infinity: right, left, above and below.
raytrace::Scene four_spots() {
  constexpr int texels = 512;
  constexpr double half_deg = 1, sigma_deg = 0.05;
  raytrace::Texture texture;
  texture.width = texture.height = texels;
  for (int row = 0; row < texels; ++row)
    for (int column = 0; column < texels; ++column) {
      const double x = ((2 * column + 1.0) / texels - 1) * half_deg,
                   y = ((2 * row + 1.0) / texels - 1) * half_deg;
      double light = 0;
      for (const double at : {-off_axis_deg, off_axis_deg})
        light += std::exp(-(std::pow(x - at, 2) + y * y) / (2 * sigma_deg * sigma_deg)) +
                 std::exp(-(x * x + std::pow(y - at, 2)) / (2 * sigma_deg * sigma_deg));
      texture.values.push_back(static_cast<float>(light));
    }
  const double half = std::tan(half_deg * degree);
  raytrace::TexturedPlane plane;
  plane.at_infinity = true;
  plane.centre_mm = {0, 0, 1};
  plane.right_mm = {-half, 0, 0};
  plane.up_mm = {0, half, 0};
  plane.texture = std::make_shared<const raytrace::Texture>(std::move(texture));
  raytrace::Scene scene;
  scene.background = Eigen::Vector3d::Zero();
  scene.planes.push_back(std::move(plane));
  return scene;
}

/// How far apart left and right, above and below lie in the picture (column and row, which run like -x and -y
/// of the eye), one column each.
Matrix2d spread(const EyeModel& eye) {
  static const raytrace::Tracer tracer("", 2);
  static const raytrace::Scene scene = four_spots();
  constexpr int pixels = 256;
  raytrace::TraceSettings settings;
  settings.grid = {pixels, pixels, 0.64, 0.64, {0, 0}};
  settings.samples = 16;
  settings.wavelength_nm = 589.3;
  settings.representation = raytrace::Representation::analytic;
  settings.verbosity.quiet = true;
  const raytrace::LinearImage image = tracer.trace(eye, scene, settings).image;
  struct Spot {
    Vector2d sum{0, 0};
    double light = 0;
    Vector2d centre() const { return sum / light; }
  };
  std::array<Spot, 4> spots;
  for (int row = 0; row < pixels; ++row)
    for (int column = 0; column < pixels; ++column) {
      const Vector2d at(column + 0.5 - pixels / 2, row + 0.5 - pixels / 2);
      const bool across = std::abs(at.x()) > std::abs(at.y());
      Spot& spot = spots[(across ? 0 : 2) + ((across ? at.x() : at.y()) > 0 ? 1 : 0)];
      const double light = image.at(column, row, 0);
      spot.sum += light * at;
      spot.light += light;
    }
  Matrix2d result;
  result.col(0) = spots[1].centre() - spots[0].centre();
  result.col(1) = spots[3].centre() - spots[2].centre();
  return result;
}

TEST(Distortion, OfTheTracedPictureIsTheClosedForm) {
  // A pinhole pupil, so that lens and eye need not suit one another: what counts is where the spots are.
  const EyeModel eye = with_pupil(make_eye("gullstrand"), 0.5);
  const double pupil_mm = entrance_pupil(eye, 589.3).position_mm;
  const Matrix2d bare = spread(eye);
  EXPECT_NEAR(bare(0, 0) / bare(1, 1), 1, 0.002);
  const auto expect_stretch = [&](const EyeModel& wearing, const PowerVector& power, double distance_mm,
                                  const std::string& what) {
    Matrix2d F;
    F << power.M_D + power.J0_D, power.J45_D, power.J45_D, power.M_D - power.J0_D;
    // In each meridian 1 / (1 - d F), d from the lens's back to the entrance pupil.
    const Matrix2d expected = (Matrix2d::Identity() - 1e-3 * (distance_mm + pupil_mm) * F).inverse();
    const Matrix2d stretch = spread(wearing) * bare.inverse();
    EXPECT_LT((stretch - expected).cwiseAbs().maxCoeff(), 0.005) << what << "\n"
                                                                 << stretch << "\n"
                                                                 << expected;
  };
  // The paper's spectacle, 50 mm and 10 mm before the cornea: a picture 12 % narrower, or 15 % wider, than
  // high.
  for (const double radius_mm : {50.0, -50.0})
    for (const double axis_deg : {90.0, 30.0})
      expect_stretch(raytrace::with_plano_cylinder(eye, radius_mm, axis_deg, 10),
                     to_power_vector({0, -500 / radius_mm, axis_deg}), 10,
                     "radius " + std::to_string(radius_mm) + " x " + std::to_string(axis_deg));
  const PowerVector oblique = to_power_vector({-4, -2, 120});
  expect_stretch(raytrace::with_thin_lens(eye, oblique, 12), oblique, 12, "thin lens");
}

}  // namespace
}  // namespace emmetrope::correction
