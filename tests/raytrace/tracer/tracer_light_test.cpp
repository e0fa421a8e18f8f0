// Diffraction and the Stiles-Crawford effect against closed forms, in eyes of one surface.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr double index = 1.336, radius_mm = 7.8, pupil_mm = 3;
constexpr double focus_mm = index * radius_mm / (index - 1);

/// A Cartesian surface (q = -1/n^2) images an infinitely distant point on its axis without aberration.
EyeModel perfect_eye(double retina_mm, double stop_mm) {
  EyeModel eye;
  eye.name = "perfect";
  eye.media["vitreous"] = Medium{index, {}, {}};
  Surface cornea, stop, retina;
  cornea.name = "cornea_anterior";
  cornea.shape = make_conic(radius_mm, -1 / (index * index));
  cornea.medium_after = "vitreous";
  stop.name = "iris";
  stop.position_mm = 1;
  stop.stop_diameter_mm = stop_mm;
  retina.name = "retina";
  retina.shape = make_plane();
  retina.position_mm = retina_mm;
  eye.surfaces = {cornea, stop, retina};
  return eye;
}

Scene at_infinity(int width, int height, std::vector<float> values, double half_angle_rad) {
  Scene scene;
  TexturedPlane plane;
  plane.at_infinity = true;
  plane.centre_mm = {0, 0, 1};
  plane.right_mm = {-std::tan(half_angle_rad), 0, 0};
  plane.up_mm = {0, std::tan(half_angle_rad), 0};
  plane.texture = std::make_shared<const Texture>(Texture{width, height, 1, std::move(values)});
  scene.planes = {plane};
  scene.background = Eigen::Vector3d::Zero();
  return scene;
}

/// Edge response of an ideal round pupil, from its MTF 2/pi (acos s - s sqrt(1 - s^2)).
double edge_response(double angle_rad, double cutoff_per_rad) {
  constexpr int n = 4000;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double s = (i + 0.5) / n;
    const double mtf = 2 / pi * (std::acos(s) - s * std::sqrt(1 - s * s));
    sum += mtf * std::sin(2 * pi * s * cutoff_per_rad * angle_rad) / s / n;
  }
  return 0.5 + sum / pi;
}

TEST(Diffraction, BlursAnEdgeAsThePupilsMtfSays) {
  EyeModel eye = perfect_eye(focus_mm, pupil_mm);
  std::vector<float> halves;
  constexpr int texels = 2048;
  for (int i = 0; i < 2 * texels; ++i) halves.push_back(i % texels < texels / 2 ? 0.F : 1.F);
  const Scene edge = at_infinity(texels, 2, halves, 2 * degree);
  const double nodal_mm = focus_mm - radius_mm;
  TraceSettings settings;
  settings.grid = {41, 8, 0.02, 0.004, {0, 0}};
  settings.samples = 8192;
  settings.wavelength_nm = 550;
  settings.verbosity.quiet = true;
  const auto profile = [&](const LinearImage& image, int column) {
    double mean = 0;
    for (int row = 0; row < 8; ++row) mean += image.at(column, row, 1) / 8;
    return mean;
  };
  const Tracer tracer("");
  const auto geometric = tracer.trace(eye, edge, settings).image;
  settings.diffraction = true;
  const auto diffracted = tracer.trace(eye, edge, settings).image;
  const double entrance_mm = entrance_pupil(eye, 550).diameter_mm;
  const double cutoff = entrance_mm / 550e-6;
  for (int column = 0; column < 41; column += 2) {
    const double angle = 0.02 * ((column + 0.5) / 41 - 0.5) / nodal_mm;
    EXPECT_NEAR(profile(diffracted, column), edge_response(angle, cutoff), 0.012) << column;
    if (std::abs(column - 20) > 1) {
      EXPECT_NEAR(profile(geometric, column), column > 20 ? 1 : 0, 0.01) << column;
    }
  }
}

/// On the retina of a sharp eye diffraction is of the eye's exit pupil, which no spectacle changes.
TEST(Diffraction, OnTheRetinaIsTheSameThroughASpectacle) {
  const EyeModel myope = perfect_eye(focus_mm + 10, 2);
  const double ametropia_D = paraxial_refraction(myope, 550).M_D;
  const double vertex_mm = 12;
  const double lens_D = ametropia_D / (1 + ametropia_D * vertex_mm / 1000);
  ASSERT_LT(lens_D, -8);
  const EyeModel worn =
      with_spectacle(myope, parse_spectacle(fmt::format("{:.6f}/0x0@{}", lens_D, vertex_mm)));
  constexpr int texels = 2048;
  std::vector<float> halves;
  for (int i = 0; i < 2 * texels; ++i) halves.push_back(i % texels < texels / 2 ? 0.F : 1.F);
  TraceSettings settings;
  settings.grid = {41, 8, 0.02, 0.004, {0, 0}};
  settings.samples = 8192;
  settings.wavelength_nm = 550;
  settings.diffraction = true;
  settings.verbosity.quiet = true;
  const LinearImage image =
      Tracer("").trace(worn, at_infinity(texels, 2, halves, 2 * degree), settings).image;
  const Pupil exit = exit_pupil(myope, 550);
  const double cutoff_per_mm =
      index * exit.diameter_mm / (550e-6 * (myope.axial_length_mm() - exit.position_mm));
  for (int column = 0; column < 41; column += 2) {
    double mean = 0;
    for (int row = 0; row < 8; ++row) mean += image.at(column, row, 1) / 8;
    const double place_mm = 0.02 * ((column + 0.5) / 41 - 0.5);
    EXPECT_NEAR(mean, edge_response(place_mm, cutoff_per_mm), 0.012) << column;
  }
}

/// How a picture of a point lies: x to the right, y up, about its centre of gravity.
struct BlurShape {
  double oblique = 0, straight = 0;    ///< (xy, (xx - yy) / 2) over (xx + yy)
  double right_skew = 0, up_skew = 0;  ///< third moments with r^2 over (xx + yy)^1.5
  double cylinder_deg() const { return std::atan2(oblique, straight) / 2 / degree; }
  double coma_deg() const { return std::atan2(up_skew, right_skew) / degree; }
};

BlurShape shape_of(int width, int height, const std::function<double(int, int)>& value) {
  double sum = 0, mean_x = 0, mean_y = 0;
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      sum += value(column, row);
      mean_x += column * value(column, row);
      mean_y -= row * value(column, row);
    }
  mean_x /= sum;
  mean_y /= sum;
  double xx = 0, xy = 0, yy = 0, right = 0, up = 0;
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const double x = column - mean_x, y = -row - mean_y, share = value(column, row) / sum;
      xx += share * x * x;
      xy += share * x * y;
      yy += share * y * y;
      right += share * x * (x * x + y * y);
      up += share * y * (x * x + y * y);
    }
  const double square = xx + yy, cube = std::pow(square, 1.5);
  return {xy / square, (xx - yy) / 2 / square, right / cube, up / cube};
}

// Fourier optics and traced rays show the same blur the same way round: an oblique cylinder and a coma that
// points neither up nor to the side.
TEST(PointSpread, LiesAsTheTracedPictureOfAPoint) {
  EyeModel eye = perfect_eye(focus_mm + 0.3, 4);
  eye.surfaces[0].shape = make_biconic(7.9, 7.6, 0, 0, 30);
  eye.surfaces[1].decentre_mm = {1.2, 0.7};
  std::vector<float> star(256 * 256, 0.F);
  for (const int i : {127, 128})
    for (const int j : {127, 128}) star[256 * j + i] = 1;
  TraceSettings settings;
  settings.grid = {100, 100, 0.8, 0.8, {0, 0}};
  settings.samples = 1024;
  settings.wavelength_nm = 550;
  settings.verbosity.quiet = true;
  const auto image = Tracer("").trace(eye, at_infinity(256, 256, star, 2 * degree), settings).image;
  const BlurShape traced = shape_of(100, 100, [&](int column, int row) { return image.at(column, row, 1); });

  WavefrontSettings wavefront_settings;
  wavefront_settings.wavelength_nm = 550;
  const PointSpread spread = point_spread(measure_wavefront(eye, wavefront_settings));
  const BlurShape computed = shape_of(spread.size, spread.size, [&](int column, int row) {
    return spread.values[static_cast<std::size_t>(row) * spread.size + column];
  });
  EXPECT_GT(std::abs(traced.oblique), 0.1);
  EXPECT_GT(std::abs(traced.right_skew), 0.1);
  EXPECT_GT(std::abs(traced.up_skew), 0.1);
  // Directions: diffraction, which the rays lack, widens the picture evenly.
  EXPECT_NEAR(computed.cylinder_deg(), traced.cylinder_deg(), 3);
  EXPECT_NEAR(computed.coma_deg(), traced.coma_deg(), 3);
}

TEST(StilesCrawford, DimsTheRimOfABlurDisc) {
  // A retina in front of the focus: a bright point gives a disc, each place of which is lit through one place
  // of the pupil.
  const EyeModel eye = perfect_eye(focus_mm - 2, 7);
  std::vector<float> star(64 * 64, 0.F);
  for (const int i : {31, 32})
    for (const int j : {31, 32}) star[64 * j + i] = 1;
  const Scene point = at_infinity(64, 64, star, 2 * degree);
  const double entrance_mm = entrance_pupil(eye, 589.3).diameter_mm;
  const double disc_mm = entrance_mm / 2 * 2 / focus_mm;  // similar triangles
  TraceSettings settings;
  settings.grid = {41, 3, 2 * disc_mm, 0.05, {0, 0}};
  settings.samples = 1 << 15;
  settings.wavelength_nm = 589.3;
  settings.verbosity.quiet = true;
  const Tracer tracer("");
  const auto plain = tracer.trace(eye, point, settings).image;
  settings.stiles_crawford_per_mm2 = 0.05;
  const auto weighted = tracer.trace(eye, point, settings).image;
  const double middle = weighted.at(20, 1, 1) / plain.at(20, 1, 1);
  for (const int column : {8, 12, 16, 24, 32}) {
    const double r_mm = std::abs((column + 0.5) / 41 - 0.5) * 2 * entrance_mm / 2;
    EXPECT_NEAR(weighted.at(column, 1, 1) / plain.at(column, 1, 1) / middle,
                std::pow(10, -0.05 * r_mm * r_mm), 0.03)
        << column;
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
