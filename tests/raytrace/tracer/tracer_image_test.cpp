// Pictures: orientation, colour, states, falloff, repeatability.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/retina/pupil_aim.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

TraceSettings quick() {
  TraceSettings settings;
  settings.grid = {40, 40, 4, 4, {0, 0}};
  settings.samples = 64;
  settings.verbosity.quiet = true;
  return settings;
}

/// A picture of 2 x 2 fields (as the patient sees them) 20 degrees wide at infinity.
Scene quadrants(const std::array<Eigen::Vector3f, 4>& colours) {
  constexpr int n = 64;
  Texture texture{n, n, 3, {}};
  for (int row = 0; row < n; ++row)
    for (int column = 0; column < n; ++column)
      for (int c = 0; c < 3; ++c)
        texture.values.push_back(colours[(row < n / 2 ? 0 : 2) + (column < n / 2 ? 0 : 1)][c]);
  Scene scene;
  TexturedPlane plane;
  plane.at_infinity = true;
  plane.centre_mm = {0, 0, 1};
  plane.right_mm = {-0.2, 0, 0};
  plane.up_mm = {0, 0.2, 0};
  plane.texture = std::make_shared<const Texture>(std::move(texture));
  scene.planes.push_back(plane);
  return scene;
}

TEST(Image, IsUprightInColourAndUnmirrored) {
  const std::array<Eigen::Vector3f, 4> colours{Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0, 1, 0),
                                               Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(1, 1, 1)};
  const auto image = Tracer("").trace(make_eye("navarro", {}), quadrants(colours), quick()).image;
  const int places[4][2] = {{8, 8}, {31, 8}, {8, 31}, {31, 31}};  // column, row: far from the borders' blur
  for (int q = 0; q < 4; ++q)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(image.at(places[q][0], places[q][1], c), colours[q][c], 2e-3) << q << " " << c;
}

TEST(Image, AchromaticPicturesHaveNoFringes) {
  // Letters are grey: whatever tells red from blue in their picture is dispersion's.
  const Tracer tracer("");
  const EyeModel eye = make_eye("navarro", {});
  const std::array<Eigen::Vector3f, 4> quarters{Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(1, 1, 1),
                                                Eigen::Vector3f(1, 1, 1), Eigen::Vector3f(0, 0, 0)};
  const Scene scene = quadrants(quarters);
  TraceSettings settings = quick();
  const auto fringes = [](const LinearImage& image) {
    double largest = 0;
    for (std::size_t i = 0; i < image.values.size(); i += 3)
      largest = std::max(largest, std::abs(double(image.values[i]) - image.values[i + 2]));
    return largest;
  };
  settings.samples = 512;
  const double spectral = fringes(tracer.trace(eye, scene, settings).image);
  settings.achromatic = true;
  const auto achromatic = tracer.trace(eye, scene, settings).image;
  settings.achromatic = false;
  settings.wavelength_nm = eye.reference_wavelength_nm;
  const auto monochromatic = tracer.trace(eye, scene, settings).image;
  EXPECT_GT(spectral, 0.1);
  EXPECT_LT(fringes(achromatic), 0.5 * spectral);  // runs of 32 rays a wavelength differ by their noise
  double mean = 0;
  for (std::size_t i = 0; i < achromatic.values.size(); ++i)
    mean += std::abs(double(achromatic.values[i]) - monochromatic.values[i]) /
            static_cast<double>(achromatic.values.size());
  EXPECT_LT(mean, 2e-3);
}

TEST(Image, PatientsRightIsMinusX) {
  // A ray that leaves through the picture's right half goes to eye -x, the patient's right.
  const EyeModel eye = make_eye("navarro", {});
  const Eigen::Vector3d retina = retina_point(eye, 1, 0).position_mm;
  const auto path = trace_exact(eye, {retina, (Eigen::Vector3d(0, 0, -3.6) - retina).normalized()}, 589.3);
  ASSERT_EQ(path.state, RayState::reached);
  EXPECT_LT(path.hits.back().direction.x(), -0.03);
}

TEST(Image, AnEvenSceneStaysEvenAndWhite) {
  const auto result = Tracer("").trace(make_eye("le-grand", {}), *make_scene("letters:contrast=0"), quick());
  for (const float value : result.image.values) EXPECT_NEAR(value, 1, 2e-4);
  std::uint64_t total = 0;
  for (const auto& [state, count] : result.states) total += count;
  EXPECT_EQ(total, result.rays);
  const double left =
      static_cast<double>(result.states.at(RayState::reached) + result.states.at(RayState::missed_scene));
  EXPECT_GT(left / static_cast<double>(result.rays), 0.95);
}

// The kernel is made for sequences of up to 16 operations and loops over longer ones.
TEST(Image, SurfacesBetweenEqualMediaChangeNothing) {
  const EyeModel eye = make_eye("gullstrand", {});
  EyeModel layered = eye;
  Surface plane = eye.surfaces.front();
  plane.shape = make_plane();
  plane.medium_after = "air";
  for (int i = 1; i <= 12; ++i) {
    plane.name = "plane_" + std::to_string(i);
    plane.position_mm = -5.0 - i;
    layered.surfaces.insert(layered.surfaces.begin(), plane);
  }
  const auto scene = make_scene("siemens");
  const TraceResult with = Tracer("").trace(layered, *scene, quick()),
                    bare = Tracer("").trace(eye, *scene, quick());
  EXPECT_EQ(with.states, bare.states);
  for (std::size_t i = 0; i < bare.image.values.size(); ++i)
    EXPECT_NEAR(with.image.values[i], bare.image.values[i], 2e-3) << i;
}

TEST(Image, IsRepeatableAndSeeded) {
  const EyeModel eye = make_eye("gullstrand", {});
  const auto scene = make_scene("siemens");
  TraceSettings settings = quick();
  const auto first = Tracer("").trace(eye, *scene, settings).image.values;
  EXPECT_EQ(first, Tracer("").trace(eye, *scene, settings).image.values);
  settings.seed = 2;
  EXPECT_NE(first, Tracer("").trace(eye, *scene, settings).image.values);
}

TEST(Image, GazeBringsTheSceneTheOtherWay) {
  // Looking 5 degrees to the left (eye +x) shows what lies 5 degrees to the left in the picture's middle.
  std::array<Eigen::Vector3f, 4> colours;
  colours.fill(Eigen::Vector3f::Zero());
  colours[0] = colours[2] = Eigen::Vector3f::Ones();  // the left half
  TraceSettings settings = quick();
  settings.grid = {4, 4, 0.2, 0.2, {0, 0}};
  const Tracer tracer("");
  settings.pose.gaze.horizontal_deg = 5;
  EXPECT_NEAR(tracer.trace(make_eye("navarro", {}), quadrants(colours), settings).image.at(1, 1, 1), 1, 1e-3);
  settings.pose.gaze.horizontal_deg = -5;
  EXPECT_NEAR(tracer.trace(make_eye("navarro", {}), quadrants(colours), settings).image.at(1, 1, 1), 0, 1e-3);
}

/// Direction of the chief ray and cross section, where the chief ray passes the entrance pupil, of the beam
/// that leaves the eye from a retinal point.
struct Beam {
  Eigen::Vector3d direction;
  double section_mm2;
};
Beam beam_from(const ExactTracer& exact, const PupilAim& aim, const Eigen::Vector3d& retina,
               double pupil_depth_mm) {
  const AimEllipse ellipse = aim.at(retina.x(), retina.y());
  const auto leave = [&](double rho, double angle) {
    const Eigen::Vector2d p =
        ellipse.centre_mm + ellipse.from_disc * (rho * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    return exact.trace_end({retina, (Eigen::Vector3d(p.x(), p.y(), aim.plane_z_mm()) - retina).normalized()});
  };
  auto chief = leave(0, 0);
  chief.position_mm -= (chief.position_mm.z() + pupil_depth_mm) / chief.direction.z() * chief.direction;
  double area = 0;
  constexpr int n = 48;
  std::vector<Eigen::Vector3d> rim;
  for (int k = 0; k < n; ++k) {
    double low = 0.8, high = 1.1;  // the stop's rim along this direction
    for (int i = 0; i < 30; ++i) {
      const double middle = 0.5 * (low + high);
      (leave(middle, 2 * pi * k / n).state == RayState::reached ? low : high) = middle;
    }
    const auto end = leave(low, 2 * pi * k / n);
    const double t =
        (chief.position_mm - end.position_mm).dot(chief.direction) / end.direction.dot(chief.direction);
    rim.push_back(end.position_mm + t * end.direction - chief.position_mm);
  }
  for (int k = 0; k < n; ++k) area += 0.5 * rim[k].cross(rim[(k + 1) % n]).dot(chief.direction);
  return {chief.direction, std::abs(area)};
}

TEST(Image, IlluminanceFallsOffAsEtendueDemands) {
  // Independent of the tracer's weights: light per retinal area = radiance x beam section x solid angle per
  // retinal area.
  // On a flat retina, where the falloff is large: a round one is lit almost evenly.
  EyeModel eye = make_eye("navarro", {});
  eye.surface("retina").shape = make_plane();
  TraceSettings settings = quick();
  settings.grid = {41, 41, 16, 16, {0, 0}};
  settings.samples = 512;
  settings.illuminance = true;
  settings.wavelength_nm = 589.3;
  const auto image = Tracer("").trace(eye, *make_scene("letters:contrast=0"), settings).image;
  const PupilAim aim(eye, settings.grid, 589.3);
  const ExactTracer exact(eye, 589.3);
  const double pupil_depth_mm = entrance_pupil(eye, 589.3).position_mm;
  const auto expected = [&](double x) {
    constexpr double h = 0.01;
    const auto at = [&](double dx, double dy) {
      return beam_from(exact, aim, retina_point(eye, x + dx, dy).position_mm, pupil_depth_mm);
    };
    const Eigen::Vector3d by_x = (at(h, 0).direction - at(-h, 0).direction) / (2 * h);
    const Eigen::Vector3d by_y = (at(0, h).direction - at(0, -h).direction) / (2 * h);
    const double retinal_area = 1 / retina_point(eye, x, 0).normal.z();  // per unit of x and y
    return at(0, 0).section_mm2 * by_x.cross(by_y).norm() / retinal_area;
  };
  const double centre = expected(0);
  for (const int column : {25, 30, 35, 39}) {
    const double x = 16 * ((column + 0.5) / 41 - 0.5);
    const double ratio = expected(x) / centre, found = image.at(column, 20, 1) / image.at(20, 20, 1);
    std::printf("x = %.2f mm: illuminance %.4f, expected %.4f\n", x, found, ratio);
    EXPECT_NEAR(found, ratio, 0.01);
  }
}

TEST(Spectacles, HaveTheirPower) {
  const EyeModel bare = make_eye("navarro", {});
  const EyeModel eye = with_thin_lens(bare, to_power_vector({-3, -1.5, 30}), 12);
  const auto slope = [&](const EyeModel& e, double angle_deg,
                         double h) {  // deflection of a ray parallel to the axis
    const Eigen::Vector2d u(std::cos(angle_deg * degree), std::sin(angle_deg * degree));
    const auto path = trace_exact(e, {{h * u.x(), h * u.y(), 40}, -Eigen::Vector3d::UnitZ()}, 589.3);
    const auto& d = path.hits[1].direction;  // behind spectacle_back
    return d.head<2>().dot(u) / -d.z() / h * 1000;
  };
  EXPECT_NEAR(-slope(eye, 30, 0.1), -3, 1e-3);     // the axis has the sphere's power
  EXPECT_NEAR(-slope(eye, 120, 0.1), -4.5, 1e-3);  // across it the cylinder is added
  const EyeModel cylinder = with_plano_cylinder(bare, 50, 90);
  EXPECT_NEAR(-slope(cylinder, 0, 0.1), -10, 1e-2);
  EXPECT_NEAR(slope(cylinder, 90, 0.1), 0, 1e-6);
  EXPECT_NEAR(cylinder.surface("spectacle_back").position_mm, -10, 1e-12);
}

TEST(Spectrum, AddsUpToWhite) {
  const Spectrum spectrum = display_spectrum();
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int k = 0; k < wavelength_count; ++k) {
    sum += spectrum.rgb_from_rgb[k];
    EXPECT_GT(spectrum.wavelength_nm[k], 400);
    EXPECT_LT(spectrum.wavelength_nm[k], 700);
    if (k > 0) {
      EXPECT_GT(spectrum.wavelength_nm[k], spectrum.wavelength_nm[k - 1]);
    }
    // each sixteenth is light: its luminance for white is not negative
    EXPECT_GE((srgb_from_xyz().inverse() * spectrum.rgb_from_rgb[k] * Eigen::Vector3d::Ones()).y(), -1e-9);
  }
  EXPECT_LT((sum - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_NEAR(cie_1931(555).y(), 1.0, 0.02);  // CIE: 1.000 at 555 nm
  EXPECT_NEAR(cie_1931(450).z(), 1.772, 0.06);
  EXPECT_NEAR(cie_1931(600).x(), 1.062, 0.04);
  EXPECT_NEAR(srgb_decoded(srgb_encoded(0.2)), 0.2, 1e-12);
}

}  // namespace
}  // namespace emmetrope::raytrace
