#include "raytrace/radiometry/irradiance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <complex>
#include <numeric>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/media/transmittance.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/optics/retina_point.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/radiometry/observer.hpp"
#include "raytrace/radiometry/spectral_scene.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "tests/support/plain_eye.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// A picture at infinity that fills 40 degrees.
Scene flat_scene(Texture texture) {
  Scene scene;
  TexturedPlane plane;
  plane.at_infinity = true;
  plane.centre_mm = {0, 0, 1};
  plane.right_mm = {-std::tan(20 * degree), 0, 0};
  plane.up_mm = {0, std::tan(20 * degree), 0};
  plane.texture = std::make_shared<const Texture>(std::move(texture));
  scene.planes = {plane};
  return scene;
}

/// Solid angle times cosine of the cone of light that a point of the retina has from the stop, by brute force.
double projected_sr(const PlainEye& eye, const Vector2d& at, const Vector3d& normal) {
  const Vector3d source = eye.retina(at);
  const Vector2d middle = -source.head<2>() / (-4.0 - source.z());
  double sum = 0;
  constexpr double reach = 0.3, step = 5e-4;
  for (double x = -reach; x <= reach; x += step)
    for (double y = -reach; y <= reach; y += step) {
      const Vector2d slope = middle + Vector2d(x, y);
      if (!(eye.leave(source, slope).in_stop.norm() < eye.stop_radius_mm)) continue;
      const double square = 1 + slope.squaredNorm();
      const Vector3d direction = Vector3d(slope.x(), slope.y(), 1) / std::sqrt(square);
      sum += normal.dot(direction) * step * step / std::pow(square, 1.5);
    }
  return sum;
}

TraceSettings small_picture(const Vector2d& centre_mm) {
  TraceSettings settings;
  settings.grid.width = settings.grid.height = 8;
  settings.grid.field_x_mm = settings.grid.field_y_mm = 0.02;
  settings.grid.centre_mm = centre_mm;
  settings.samples = 4096;
  return settings;
}

/// Tangent of the angle at the retina's pole of the ray along the stop's rim.
double rim_slope(const PlainEye& plain) {
  double inside = 0, outside = 0.5;
  for (int k = 0; k < 50; ++k) {
    const double middle = (inside + outside) / 2;
    (plain.leave(plain.retina({0, 0}), {middle, 0}).in_stop.norm() < plain.stop_radius_mm ? inside
                                                                                          : outside) = middle;
  }
  return inside;
}

/// Of the pupil as it is seen: where that ray, out of the eye, crosses the entrance pupil's plane.
double seen_area_mm2(const EyeModel& eye) {
  const double nm = eye.reference_wavelength_nm;
  const PlainEye plain(eye, nm);
  const PlainRay ray = plain.leave(plain.retina({0, 0}), {rim_slope(plain), 0});
  const double to_plane = (-entrance_pupil(eye, nm).position_mm - ray.at.z()) / ray.direction.z();
  return pi * std::pow(ray.at.x() + to_plane * ray.direction.x(), 2);
}

TEST(Irradiance, OfALambertianPlaneIsThatOfItsConeOfLight) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(5);
  IrradianceSettings settings;
  settings.luminance_cd_m2 = 250;
  settings.first_nm = 450;
  settings.last_nm = 650;
  settings.step_nm = 100;
  settings.age_years = 60;
  const DisplayLight display(250);
  const Scene white = flat_scene({2, 2, 1, {1, 1, 1, 1}});
  const Tracer tracer("");
  for (const Vector2d& at : {Vector2d(0, 0), Vector2d(3, -2)}) {
    const RetinalIrradiance light = retinal_irradiance(tracer, eye, white, small_picture(at), {}, settings);
    ASSERT_EQ(light.wavelength_nm.size(), 3U);
    for (std::size_t band = 0; band < 3; ++band) {
      const double nm = light.wavelength_nm[band];
      const PlainEye plain(eye, nm);
      const double n = eye.medium("vitreous").index_at(nm, eye.reference_wavelength_nm);
      const double vitreous_side = projected_sr(plain, at, meet_retina(eye, at)->normal);
      const double expected =
          n * n * ocular_transmittance(nm, 60) * display.radiance(nm).sum() * vitreous_side;
      double mean = 0;
      for (const float value : light.irradiance[band].values) mean += value / 64;
      EXPECT_NEAR(mean, expected, 0.005 * expected) << nm << " nm at " << at.transpose();
      EXPECT_NEAR(light.transmittance[band], ocular_transmittance(nm, 60), 1e-12);
    }
  }
}

TEST(Irradiance, OnTheAxisIsPiSineSquared) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(4);
  IrradianceSettings settings;
  settings.first_nm = settings.last_nm = 550;
  const RetinalIrradiance light = retinal_irradiance(Tracer(""), eye, flat_scene({2, 2, 1, {1, 1, 1, 1}}),
                                                     small_picture({0, 0}), {}, settings);
  const PlainEye plain(eye, 550);
  const double sine = std::sin(std::atan(rim_slope(plain))),
               n = eye.medium("vitreous").index_at(550, eye.reference_wavelength_nm);
  const double expected =
      n * n * ocular_transmittance(550, 40) * DisplayLight(100).radiance(550).sum() * pi * sine * sine;
  EXPECT_NEAR(light.irradiance[0].values[27], expected, 0.005 * expected);
  // And by the luminance that was asked for: trolands are its product with the pupil.
  EXPECT_NEAR(light.white_trolands / (100 * seen_area_mm2(eye)), 1, 1e-5);
}

TEST(Irradiance, ThePupilOfTrolandsIsAsWideAsItIsSeen) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(8);
  IrradianceSettings settings;
  settings.first_nm = settings.last_nm = 550;
  TraceSettings trace = small_picture({0, 0});
  trace.samples = 32;
  const auto area_of = [&](const EyeModel& worn) {
    return retinal_irradiance(Tracer(""), worn, flat_scene({2, 2, 1, {1, 1, 1, 1}}), trace, {}, settings)
        .pupil_area_mm2;
  };
  EXPECT_NEAR(area_of(eye) / seen_area_mm2(eye), 1, 1e-5);
  const double paraxial_mm = entrance_pupil(eye, eye.reference_wavelength_nm).diameter_mm;
  EXPECT_NEAR(area_of(eye) / (pi * paraxial_mm * paraxial_mm / 4), 0.9275, 1e-3);
  EXPECT_EQ(area_of(with_spectacle(eye, parse_spectacle("-8/0x0@12"))), area_of(eye));
}

TEST(DisplayLight, WhiteHasTheLuminanceThatIsAskedFor) {
  const DisplayLight display(80);
  double luminance = 0;
  for (double nm = 385; nm < 780; nm += 2)
    luminance += 683.002 * luminous_efficiency(nm) * display.radiance(nm).sum() * 2;
  EXPECT_NEAR(luminance, 80, 0.1);
}

/// Contrast of a grating for the cones, by plain rays.
Vector3d grating_contrast(const EyeModel& eye, const IrradianceSettings& settings, double cycles_per_degree) {
  const DisplayLight display(settings.luminance_cd_m2);
  Eigen::Vector3cd sum = Eigen::Vector3cd::Zero();
  Vector3d light = Vector3d::Zero();
  for (const double nm : settings.wavelengths_nm()) {
    const PlainEye plain(eye, nm);
    const Vector3d source = plain.retina({0, 0});
    std::complex<double> transfer = 0;
    double weight = 0;
    constexpr double reach = 0.2, step = 1e-3;
    for (double x = -reach; x <= reach; x += step)
      for (double y = -reach; y <= reach; y += step) {
        const PlainRay ray = plain.leave(source, {x, y});
        if (!(ray.in_stop.norm() < plain.stop_radius_mm)) continue;
        const double share = std::pow(1 + x * x + y * y, -2);  // solid angle and cosine
        const double angle_deg = std::atan(ray.direction.x() / ray.direction.z()) / degree;
        transfer += share * std::polar(1.0, 2 * pi * cycles_per_degree * angle_deg);
        weight += share * step * step;
      }
    transfer *= step * step;
    const double n = eye.medium("vitreous").index_at(nm, eye.reference_wavelength_nm);
    const Vector3d cones = n * n * display.radiance(nm).sum() * cone_fundamentals(nm);
    sum += cones * transfer;
    light += cones * weight;
  }
  return sum.cwiseAbs().cwiseQuotient(light);
}

TEST(Irradiance, ConesSeeAGratingWithTheContrastThatPlainRaysGive) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(4);
  constexpr double cycles_per_degree = 4;
  // Columns of the texture are even in the tangent: the grating is sinusoidal in the angle.
  constexpr int columns = 8192;
  Texture grating{columns, 2, 1, std::vector<float>(std::size_t{2} * columns)};
  for (int i = 0; i < columns; ++i) {
    const double angle_deg = std::atan((2 * (i + 0.5) / columns - 1) * std::tan(20 * degree)) / degree;
    grating.values[i] = grating.values[columns + i] =
        static_cast<float>(0.5 + 0.5 * std::cos(2 * pi * cycles_per_degree * angle_deg));
  }
  TraceSettings trace;
  trace.grid.width = 64;
  trace.grid.height = 4;
  trace.grid.field_x_mm = 0.3;
  trace.grid.field_y_mm = 0.02;
  trace.samples = 4096;
  IrradianceSettings settings;
  settings.step_nm = 20;
  const RetinalIrradiance light =
      retinal_irradiance(Tracer(""), eye, flat_scene(std::move(grating)), trace, {}, settings);
  const Vector3d expected = grating_contrast(eye, settings, cycles_per_degree);
  // A sinusoid in the angle that each column's chief ray has, by least squares.
  const PlainEye plain(eye, 555);
  Eigen::Matrix<double, 64, 3> design;
  for (int column = 0; column < 64; ++column) {
    const PlainPupil pupil(plain, {0.3 * ((column + 0.5) / 64 - 0.5), 0}, 3);
    const double phase = 2 * pi * cycles_per_degree * std::atan(pupil.sight.x() / pupil.sight.z()) / degree;
    design.row(column) << 1, std::cos(phase), std::sin(phase);
  }
  for (int cone = 0; cone < 3; ++cone) {
    Eigen::Matrix<double, 64, 1> seen = Eigen::Matrix<double, 64, 1>::Zero();
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 64; ++column) seen[column] += light.cones.at(column, row, cone);
    const Vector3d fit = design.colPivHouseholderQr().solve(seen);
    EXPECT_NEAR(fit.tail<2>().norm() / fit[0], expected[cone], 0.01) << "cone " << cone;
  }
  EXPECT_GT(expected[0], 2 * expected[2]);  // chromatic aberration takes the short wavelengths' detail
}

/// CIE 1931 has (1.0622, 0.6310, 0.0008) at 600 nm: linear sRGB 2.47, 0.154 and below 0, whatever the luminance.
TEST(SpectralPicture, HasOneColourAtEveryLuminance) {
  const Texture shown = SpectralPicture{{600}, {{2, 1, 1, {1.0F, 0.25F}}}}.coloured();
  EXPECT_NEAR(shown.values[0], 1, 1e-6);
  EXPECT_NEAR(shown.values[3], 0.25, 1e-6);
  for (const std::size_t texel : {0U, 3U}) {
    EXPECT_NEAR(shown.values[texel + 1] / shown.values[texel], 0.154 / 2.47, 0.01);
    EXPECT_EQ(shown.values[texel + 2], 0);
  }
}

TEST(Irradiance, OfASpectralPictureFollowsItsSpectrum) {
  EyeModel eye = make_eye("navarro");
  const Texture dim{2, 2, 1, {0.01F, 0.01F, 0.01F, 0.01F}}, bright{2, 2, 1, {0.03F, 0.03F, 0.03F, 0.03F}};
  SpectralPicture spectrum{{500, 600}, {dim, bright}};
  Scene scene = flat_scene(spectrum.coloured());
  scene.planes[0].spectrum = std::make_shared<const SpectralPicture>(spectrum);
  IrradianceSettings settings;
  settings.first_nm = 450;
  settings.last_nm = 600;
  settings.step_nm = 50;
  const RetinalIrradiance light =
      retinal_irradiance(Tracer(""), eye, scene, small_picture({0, 0}), {}, settings);
  const auto radiance = [&](std::size_t band) {
    const double nm = light.wavelength_nm[band],
                 n = eye.medium("vitreous").index_at(nm, eye.reference_wavelength_nm);
    const PlainEye plain(eye, nm);
    return light.irradiance[band].values[27] /
           (n * n * light.transmittance[band] * projected_sr(plain, {0, 0}, {0, 0, 1}));
  };
  EXPECT_EQ(light.irradiance[0].values[27], 0);  // no light outside the picture's wavelengths
  EXPECT_NEAR(radiance(1), 0.01, 0.0001);
  EXPECT_NEAR(radiance(2), 0.02, 0.0002);
  EXPECT_NEAR(radiance(3), 0.03, 0.0003);
}

TEST(Irradiance, OfWhiteIsItsLuminanceTimesThePupilInTrolands) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(4);
  IrradianceSettings settings;
  settings.luminance_cd_m2 = 80;
  TraceSettings trace = small_picture({0, 0});
  trace.samples = 512;
  const Tracer tracer("");
  const RetinalIrradiance light =
      retinal_irradiance(tracer, eye, flat_scene({2, 2, 1, {1, 1, 1, 1}}), trace, {}, settings);
  const double wanted_td = 80 * seen_area_mm2(eye);
  EXPECT_NEAR(light.white_trolands, wanted_td, 1e-5 * wanted_td);
  const std::vector<float>& trolands = light.trolands.values;
  // Of bands of 10 nm from 400 to 700, which miss 0.1 % of V.
  EXPECT_NEAR(std::accumulate(trolands.begin(), trolands.end(), 0.0) / static_cast<double>(trolands.size()),
              wanted_td, 0.005 * wanted_td);
}

TEST(Irradiance, BadSettingsNameTheirOption) {
  IrradianceSettings settings;
  settings.last_nm = 390;
  EXPECT_ANY_THROW(settings.check());
  settings = {};
  settings.luminance_cd_m2 = 0;
  EXPECT_ANY_THROW(settings.check());
  settings = {};
  settings.age_years = 200;
  EXPECT_ANY_THROW(settings.check());
}

// Behind steps of the eye's own motion each picture is a multiple of its own middle's light: few rays make these differ.
TEST(Irradiance, OfAMovingEyeIsTheMeanOfItsPlaces) {
  const EyeModel eye = make_eye("navarro");
  TraceSettings trace = small_picture({0, 0});
  trace.samples = 64;
  IrradianceSettings settings;
  settings.first_nm = settings.last_nm = 550;
  Exposure still, moving;
  moving.eye_motion_deg = {1, 0};
  const Scene white = flat_scene({2, 2, 1, {1, 1, 1, 1}});
  const Tracer tracer("");
  const auto mean = [&](const Exposure& exposure) {
    const LinearImage light = retinal_irradiance(tracer, eye, white, trace, exposure, settings).irradiance[0];
    return std::accumulate(light.values.begin(), light.values.end(), 0.0) /
           static_cast<double>(light.values.size());
  };
  EXPECT_NEAR(mean(moving) / mean(still), 1, 2e-3);
}

TEST(Irradiance, OfALitSurfaceIsItsReflectanceTimesTheLightsRadiance) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(4);
  // A large sheet 400 mm away, lit square on, nothing else; against a display's picture of one value.
  MeshObject sheet;
  sheet.positions_mm = {{-400, -400, 400}, {400, -400, 400}, {400, 400, 400}, {-400, 400, 400}};
  sheet.normals.assign(4, {0, 0, -1});
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  sheet.material.reflectance = SampledSpectrum{{450, 650}, {0.2, 0.8}};
  Scene scene;
  scene.background = scene.ambient = Vector3d::Zero();
  scene.meshes = {sheet};
  Light lamp;
  lamp.directional = true;
  lamp.at = {0, 0, -1};
  lamp.radiance = SampledSpectrum{{400, 600, 900}, {0.02, 0.05, 0.01}};
  scene.lights = {lamp};
  IrradianceSettings settings;
  settings.luminance_cd_m2 = 100;
  settings.first_nm = 450;
  settings.last_nm = 850;  // where the display has no light
  settings.step_nm = 100;
  const Tracer tracer("");
  const RetinalIrradiance light = retinal_irradiance(tracer, eye, scene, small_picture({0, 0}), {}, settings);
  const auto between = [](double nm, double a, double b, double at_a, double at_b) {
    return at_a + (nm - a) / (b - a) * (at_b - at_a);
  };
  for (std::size_t band = 0; band < light.wavelength_nm.size(); ++band) {
    const double nm = light.wavelength_nm[band];
    const double reflectance = nm >= 650 ? 0.8 : between(nm, 450, 650, 0.2, 0.8);
    const double lamp_radiance =
        nm < 600 ? between(nm, 400, 600, 0.02, 0.05) : between(nm, 600, 900, 0.05, 0.01);
    const PlainEye plain(eye, nm);
    const double index = eye.medium("vitreous").index_at(nm, eye.reference_wavelength_nm);
    const double expected = index * index * ocular_transmittance(nm, 40, MediaField::small) *
                            projected_sr(plain, {0, 0}, {0, 0, 1}) * reflectance * lamp_radiance;
    const std::vector<float>& values = light.irradiance[band].values;
    const double mean =
        std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
    EXPECT_NEAR(mean, expected, 0.005 * expected) << nm;
  }
}

TEST(Irradiance, OfADimSpectrumIsNotLostBesideAWhiteThatIsNotThere) {
  // Radiances of twilight, a ten thousandth of a display's white.
  const float dim = 1e-7F;
  Scene scene = flat_scene({2, 2, 1, {0, 0, 0, 0}});
  scene.background.setZero();
  scene.planes[0].spectrum = std::make_shared<const SpectralPicture>(SpectralPicture{
      {500, 600}, {{2, 2, 1, {dim, dim / 2, dim, dim}}, {2, 2, 1, {dim, dim / 2, dim, dim}}}});
  const SceneAtWavelength shown = at_wavelength(scene, DisplayLight(100), 550);
  EXPECT_NEAR(shown.unit / dim, 1, 1e-6);
  EXPECT_NEAR(shown.scene.planes[0].texture->values[1], 0.5, 1e-6);
}

}  // namespace
}  // namespace emmetrope::raytrace
