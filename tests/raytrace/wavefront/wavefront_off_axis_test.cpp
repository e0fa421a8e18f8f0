#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <vector>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/wavefront/wavefront.hpp"
#include "tests/support/plain_eye.hpp"
#include "tests/support/random_conic_eye.hpp"

/// Wavefront, spots and MTF off the axis against plain rays, spread evenly over the stop and weighted by what they
/// cover of the entrance pupil.
namespace emmetrope::raytrace {
namespace {

using Eigen::Vector2d;

constexpr double wavelength_nm = 555;
constexpr int order = 8;

/// What the test knows of a pupil.
struct PlainWavefront {
  double radius_mm = 0;
  Eigen::VectorXd zernike_um;
  double spot_rms_arcmin = 0, rms_um = 0;
  std::vector<double> rim_mm;  ///< at even angles of the plane

  double rim(const Vector2d& at) const {
    const auto angles = static_cast<double>(rim_mm.size());
    const double place = (std::atan2(at.y(), at.x()) / (2 * pi) + 1) * angles;
    return rim_mm[static_cast<std::size_t>(place + 0.5) % rim_mm.size()];
  }
  bool holds(const Vector2d& at) const { return at.norm() <= rim(at); }
  double at_um(const Vector2d& at) const {
    return zernike_um.dot(zernike_values(order, at.x() / radius_mm, at.y() / radius_mm));
  }
  /// The overlap of the pupil with itself moved by `shift_mm`, with the difference in phase.
  double mtf(const Vector2d& shift_mm) const {
    constexpr int cells = 240;
    std::complex<double> sum = 0;
    int inside = 0;
    for (int i = 0; i < cells; ++i)
      for (int j = 0; j < cells; ++j) {
        const Vector2d at = radius_mm * Vector2d(2 * (i + 0.5) / cells - 1, 2 * (j + 0.5) / cells - 1);
        if (!holds(at)) continue;
        ++inside;
        const Vector2d other = at - shift_mm;
        if (holds(other))
          sum += std::polar(1.0, 2 * pi * (at_um(at) - at_um(other)) / (wavelength_nm / 1000));
      }
    return std::abs(sum) / inside;
  }
};

PlainWavefront plain_wavefront(const PlainEye& eye, const PlainPupil& pupil) {
  PlainWavefront result;
  constexpr int rim_points = 4000, angles = 1440;
  std::vector<Vector2d> rim;
  for (int k = 0; k < rim_points; ++k) {
    const double angle = 2 * pi * k / rim_points;
    rim.push_back(pupil.in_plane(eye.stop_radius_mm * Vector2d(std::cos(angle), std::sin(angle))).at);
    result.radius_mm = std::max(result.radius_mm, rim.back().norm());
  }
  result.rim_mm.assign(angles, 0);
  for (const Vector2d& point : rim) {  // four to an angle
    const double place = (std::atan2(point.y(), point.x()) / (2 * pi) + 1) * angles;
    result.rim_mm[static_cast<std::size_t>(place + 0.5) % angles] = point.norm();
  }

  constexpr int rings = 60, spokes = 72;
  Eigen::MatrixXd terms(rings * spokes, zernike_count(order));
  Eigen::MatrixXd tilts(rings * spokes, 3);
  Eigen::VectorXd wavefront_um(rings * spokes), root(rings * spokes);
  Vector2d mean(0, 0);
  double area = 0, square = 0;
  std::vector<std::pair<Vector2d, double>> slopes;
  for (int i = 0; i < rings; ++i)
    for (int k = 0; k < spokes; ++k) {
      const double r = eye.stop_radius_mm * std::sqrt((i + 0.5) / rings), angle = 2 * pi * (k + 0.5) / spokes;
      const Vector2d in_stop = r * Vector2d(std::cos(angle), std::sin(angle));
      const PlainPupil::Place place = pupil.in_plane(in_stop);
      const double weight = pupil.magnification(in_stop);
      const int row = i * spokes + k;
      terms.row(row) =
          zernike_values(order, place.at.x() / result.radius_mm, place.at.y() / result.radius_mm).transpose();
      tilts.row(row) << 1, place.at.x(), place.at.y();
      wavefront_um[row] = place.wavefront_um;
      root[row] = std::sqrt(weight);
      slopes.emplace_back(place.slope, weight);
      mean += weight * place.slope;
      area += weight;
    }
  mean /= area;
  for (const auto& [slope, weight] : slopes) square += weight * (slope - mean).squaredNorm();
  result.spot_rms_arcmin = std::sqrt(square / area) / degree * 60;
  const auto weighted = [&](const Eigen::MatrixXd& columns) -> Eigen::MatrixXd {
    return root.asDiagonal() * columns;
  };
  const Eigen::VectorXd right = root.asDiagonal() * wavefront_um;
  result.zernike_um = weighted(terms).colPivHouseholderQr().solve(right);
  const Eigen::VectorXd tilt = weighted(tilts).colPivHouseholderQr().solve(right);
  result.rms_um = (weighted(tilts) * tilt - right).norm() / std::sqrt(area);
  return result;
}

void expect_even_rays_wavefront(const EyeModel& eye, const Vector2d& at) {
  WavefrontSettings settings;
  settings.wavelength_nm = wavelength_nm;
  settings.order = order;
  settings.fovea_mm = at;
  const Wavefront wavefront = measure_wavefront(eye, settings);
  const PlainEye plain(eye, wavelength_nm);
  const PlainPupil pupil(plain, at, entrance_pupil(eye, wavelength_nm).position_mm);
  const PlainWavefront expected = plain_wavefront(plain, pupil);

  EXPECT_NEAR(std::tan(wavefront.line_of_sight_deg.x() * degree), pupil.sight.x() / pupil.sight.z(), 1e-8);
  EXPECT_NEAR(wavefront.pupil_mm / 2, expected.radius_mm, 1e-5);
  for (int j = 1; j < zernike_count(order); ++j)
    EXPECT_NEAR(wavefront.zernike_um[j], expected.zernike_um[j], 1e-4) << j;
  EXPECT_NEAR(wavefront.rms_um(), expected.rms_um, 0.005 * expected.rms_um);
  EXPECT_NEAR(wavefront.spot_rms_arcmin(), expected.spot_rms_arcmin, 0.01 * expected.spot_rms_arcmin);

  const ImageQuality quality = image_quality(wavefront);
  const Vector2d tangential = at.isZero() ? Vector2d(0, 1) : pupil.tangential(),
                 sagittal(tangential.y(), -tangential.x());
  for (const int cpd : {3, 10, 20, 30, 45}) {
    const double shift_mm = cpd * wavelength_nm * 1e-6 / degree;
    EXPECT_NEAR(quality.mtf_tangential[cpd], expected.mtf(shift_mm * tangential), 0.005) << cpd;
    EXPECT_NEAR(quality.mtf_sagittal[cpd], expected.mtf(shift_mm * sagittal), 0.005) << cpd;
  }
}

class OffAxis : public testing::TestWithParam<int> {};

// From the axis to 64 degrees of the visual field, in all directions.
TEST_P(OffAxis, IsThatOfEvenRaysThroughTheStop) {
  const int seed = GetParam();
  EyeModel eye = random_conic_eye(seed);
  eye.set_stop_diameter(2 + 0.25 * seed);
  const double angle = 2.4 * seed;
  expect_even_rays_wavefront(eye, 11.2 * seed / 9 * Vector2d(std::cos(angle), std::sin(angle)));
}
INSTANTIATE_TEST_SUITE_P(TenRandomEyes, OffAxis, testing::Range(0, 10));

// Behind a plane lens the entrance pupil swells towards the periphery, and aims map to it far from linearly.
class BehindASpectacle : public testing::TestWithParam<std::pair<const char*, double>> {};
TEST_P(BehindASpectacle, IsThatOfEvenRaysThroughTheStop) {
  const auto& [lens, field_deg] = GetParam();
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(3.5);
  eye = with_spectacle(eye, parse_spectacle(lens));
  const auto at = ChiefRays(eye, wavelength_nm).image_of({std::tan(field_deg * degree), 0, 1});
  ASSERT_TRUE(at);
  expect_even_rays_wavefront(eye, at->position_mm.head<2>());
}
INSTANTIATE_TEST_SUITE_P(AtWideAngles, BehindASpectacle,
                         testing::Values(std::pair("-4/0x0@12", 30.0), std::pair("-4/0x0@12", 50.0),
                                         std::pair("-8/0x0@12", 45.0), std::pair("4/0x0@12", 40.0)));

// The thin pencil about the ray through the stop's centre, in the plane of the corneal vertex across it.
TEST(OffAxisWavefront, ADecentredStopMovesTheRefraction) {
  for (int seed = 1; seed < 5; ++seed) {
    EyeModel eye = random_conic_eye(seed);
    const PowerVector centred = paraxial_refraction(eye, wavelength_nm);
    eye.surface("iris").decentre_mm = {0.5, 0.3};
    const PlainEye plain(eye, wavelength_nm);
    const PlainPupil pupil(plain, {0, 0}, 0);
    constexpr double h = 0.01;
    Eigen::Matrix2d place, slope;
    for (int k = 0; k < 2; ++k) {
      const Vector2d step = h * Vector2d::Unit(k);
      place.col(k) = pupil.in_plane(step).at - pupil.in_plane(-step).at;
      slope.col(k) = pupil.in_plane(step).slope - pupil.in_plane(-step).slope;
    }
    const PowerVector expected = power_from_vergence(slope * place.inverse());
    const PowerVector found = paraxial_refraction(eye, wavelength_nm);
    EXPECT_NEAR(found.M_D, expected.M_D, 1e-4);
    EXPECT_NEAR(found.J0_D, expected.J0_D, 1e-4);
    EXPECT_NEAR(found.J45_D, expected.J45_D, 1e-4);
    EXPECT_GT(std::abs(found.M_D - centred.M_D), 0.01);
  }
}

TEST(OffAxisWavefront, TheStilesCrawfordEffectWeighsRaysAndNarrowsTheSpot) {
  EyeModel eye = make_eye("navarro");
  eye.set_stop_diameter(6);
  WavefrontSettings settings;
  const Wavefront even = measure_wavefront(eye, settings);
  settings.stiles_crawford_per_mm2 = 0.05;
  const Wavefront weighted = measure_wavefront(eye, settings);
  const Wavefront::PupilRay& ray = weighted.rays.back();
  EXPECT_NEAR(weighted.light_share(ray) / ray.area_share, std::pow(10, -0.05 * ray.place_mm.squaredNorm()),
              1e-12);
  EXPECT_LT(weighted.spot_rms_arcmin(), 0.95 * even.spot_rms_arcmin());
  EXPECT_EQ(weighted.zernike_um, even.zernike_um);
  // A spectacle makes the pupil look larger or smaller; a place in the stop has its receptors' weight all the same.
  const double rim = weighted.receptor_weight({weighted.pupil_mm / 2, 0});
  for (const char* lens : {"-10/0x0@12", "+10/0x0@12"}) {
    const Wavefront worn = measure_wavefront(with_spectacle(eye, parse_spectacle(lens)), settings);
    EXPECT_GT(std::abs(worn.pupil_mm / weighted.pupil_mm - 1), 0.1);
    EXPECT_NEAR(worn.receptor_weight({worn.pupil_mm / 2, 0}), rim, 0.02 * rim) << lens;
  }
  // A perfect pupil with amplitude exp(-a r^2 / 2), a = 0.05 ln 10, so wide that its rim is dark: the overlap of
  // two such Gaussians falls as exp(-a s^2 / 4).
  Wavefront perfect;
  perfect.pupil_mm = 20;
  perfect.wavelength_nm = wavelength_nm;
  perfect.zernike_um.assign(15, 0.0);
  perfect.stiles_crawford_per_mm2 = 0.05;
  const ImageQuality quality = image_quality(perfect);
  EXPECT_NEAR(quality.strehl, 1, 1e-9);
  for (const int cpd : {10, 30, 60, 120}) {
    const double s = cpd * wavelength_nm * 1e-6 / degree;
    EXPECT_NEAR(quality.mtf_tangential[cpd], std::exp(-std::log(10.0) * 0.05 * s * s / 4), 2e-3) << cpd;
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
