#include <gmock/gmock.h>

#include <cmath>
#include <numeric>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/wavefront/contrast_sensitivity.hpp"
#include "raytrace/wavefront/pupil_function.hpp"

namespace emmetrope::raytrace {
namespace {

Wavefront perfect(double pupil_mm, double wavelength_nm) {
  Wavefront wavefront;
  wavefront.pupil_mm = pupil_mm;
  wavefront.wavelength_nm = wavelength_nm;
  wavefront.zernike_um.assign(45, 0.0);
  return wavefront;
}

TEST(ImageQuality, PerfectPupilHasTheMtfOfDiffraction) {
  const Wavefront wavefront = perfect(3, 555);
  const ImageQuality quality = image_quality(wavefront);
  EXPECT_NEAR(quality.strehl, 1, 1e-12);
  EXPECT_NEAR(quality.vsotf, 1, 1e-12);
  const double cutoff_cpd = 3 / 0.555e-3 * degree;
  for (std::size_t k = 0; k < quality.cpd.size(); ++k) {
    const double v = quality.cpd[k] / cutoff_cpd;
    const double expected = 2 / pi * (std::acos(v) - v * std::sqrt(1 - v * v));
    EXPECT_NEAR(quality.mtf_sagittal[k], expected, 1e-3);
    EXPECT_NEAR(quality.mtf_tangential[k], expected, 1e-3);
  }
}

TEST(ImageQuality, SmallAberrationsFollowMarechal) {
  for (const int j : {4, 5, 7, 12}) {
    Wavefront wavefront = perfect(4, 555);
    wavefront.zernike_um[j] = 0.555 / 30;
    const double expected = std::exp(-std::pow(2 * pi / 30, 2));
    EXPECT_NEAR(image_quality(wavefront).strehl, expected, 2e-3) << j;
  }
}

TEST(ImageQuality, DefocusHasTheClosedFormStrehl) {
  // The axial intensity of a defocused circular pupil is sinc^2 of half the edge's phase.
  Wavefront wavefront = perfect(4, 555);
  wavefront.zernike_um[4] = 0.06;
  const double edge_phase = 2 * pi / 0.555 * 0.06 * 2 * std::sqrt(3.0);
  const double sinc = std::sin(edge_phase / 2) / (edge_phase / 2);
  EXPECT_NEAR(image_quality(wavefront).strehl, sinc * sinc, 2e-3);
}

TEST(ImageQuality, StrehlIsThePeakBetweenTheGridsAngles) {
  // Coma moves the peak along y: |mean over the pupil of exp(2 pi i (W - t y) / wavelength)|^2 at its best t,
  // by midpoints in r^2 and angle.
  for (const double coma_um : {0.05, 0.11, 0.2}) {
    Wavefront wavefront = perfect(4, 555);
    wavefront.zernike_um[7] = coma_um;
    double largest = 0;
    for (double t_um = -2; t_um <= 2; t_um += 0.005) {
      constexpr int rings = 40, spokes = 80;
      std::complex<double> sum = 0;
      for (int i = 0; i < rings; ++i)
        for (int k = 0; k < spokes; ++k) {
          const double r = std::sqrt((i + 0.5) / rings), y = r * std::sin(2 * pi * (k + 0.5) / spokes);
          const double w = coma_um * std::sqrt(8.0) * (3 * r * r - 2) * y;
          sum += std::polar(1.0 / (rings * spokes), 2 * pi * (w - t_um * y) / 0.555);
        }
      largest = std::max(largest, std::norm(sum));
    }
    EXPECT_NEAR(image_quality(wavefront).strehl, largest, 2e-3) << coma_um;
  }
}

TEST(ImageQuality, ABlurBeyondTheGridIsNamed) {
  Wavefront wavefront = perfect(3, 555);
  wavefront.zernike_um[4] = 20 * 2.25 / (4 * std::sqrt(3.0));  // -20 D
  EXPECT_FALSE(point_spread(wavefront).wraps);
  wavefront.pupil_mm = 8;
  wavefront.zernike_um[4] = 20 * 16 / (4 * std::sqrt(3.0));
  EXPECT_TRUE(point_spread(wavefront).wraps);
}

TEST(ImageQuality, TheLensTakesAwayWhatItCorrects) {
  Wavefront wavefront = perfect(4, 555);
  // M = -4 sqrt3 c20 / r^2 and so on for a refraction of -1.5, 0.4, -0.3 D.
  wavefront.zernike_um[4] = 1.5 * 4 / (4 * std::sqrt(3.0));
  wavefront.zernike_um[5] = -0.4 * 4 / (2 * std::sqrt(6.0));
  wavefront.zernike_um[3] = 0.3 * 4 / (2 * std::sqrt(6.0));
  EXPECT_LT(image_quality(wavefront).strehl, 0.05);
  EXPECT_NEAR(image_quality(wavefront, {-1.5, 0.4, -0.3}).strehl, 1, 1e-9);
}

TEST(ImageQuality, TiltMovesNothing) {
  Wavefront wavefront = perfect(4, 555);
  wavefront.zernike_um[1] = 3;
  wavefront.zernike_um[2] = -2;
  EXPECT_NEAR(image_quality(wavefront).vsotf, 1, 1e-12);
}

TEST(ImageQuality, AstigmatismBlursOneMeridian) {
  // Defocus in x alone: detail that varies along x (sagittal) is lost, along y kept.
  Wavefront wavefront = perfect(4, 555);
  wavefront.zernike_um[4] = 0.2;
  wavefront.zernike_um[5] = 0.2 * std::sqrt(2.0);
  const ImageQuality quality = image_quality(wavefront);
  EXPECT_LT(quality.mtf_sagittal[20], 0.5 * quality.mtf_tangential[20]);
}

TEST(PointSpread, HasUnitSumAndComaPointsTheRightWay) {
  Wavefront wavefront = perfect(4, 555);
  wavefront.zernike_um[7] = 0.3;  // vertical coma: W grows with y^3
  const PointSpread spread = point_spread(wavefront);
  EXPECT_NEAR(std::accumulate(spread.values.begin(), spread.values.end(), 0.0), 1, 1e-3);
  // Slopes dW/dy of 9 y^2 - 2 are positive at the edge: the tail points up, to small rows.
  double above = 0, below = 0;
  const int half = spread.size / 2;
  for (int row = 0; row < spread.size; ++row)
    for (int column = 0; column < spread.size; ++column) {
      const double value = spread.values[static_cast<std::size_t>(row) * spread.size + column];
      const double up = (half - row) * spread.pitch_arcmin;
      if (up > 2) above += value;
      if (up < -2) below += value;
    }
  EXPECT_GT(above, 2 * below);
}

// Geometrical optics: a disc of pupil times defocus, here 30 mrad = 103 arcmin, none of it folded over.
TEST(PointSpread, StrongDefocusFillsItsDiscEvenly) {
  constexpr double pupil_mm = 5, defocus_D = 6;
  Wavefront wavefront = perfect(pupil_mm, 589.3);
  wavefront.zernike_um[4] = defocus_D * pupil_mm * pupil_mm / 4 / (4 * std::sqrt(3.0));
  const PointSpread spread = point_spread(wavefront);
  const double radius_arcmin = pupil_mm * defocus_D / 2 * 1e-3 / degree * 60;
  double inside = 0, inner_half = 0;
  const int half = spread.size / 2;
  for (int row = 0; row < spread.size; ++row)
    for (int column = 0; column < spread.size; ++column) {
      const double r = std::hypot(row - half, column - half) * spread.pitch_arcmin;
      const double value = spread.values[static_cast<std::size_t>(row) * spread.size + column];
      if (r < 1.05 * radius_arcmin) inside += value;
      if (r < radius_arcmin / std::sqrt(2)) inner_half += value;
    }
  EXPECT_GT(inside, 0.97);
  EXPECT_NEAR(inner_half, 0.5, 0.02);
}

TEST(ContrastSensitivity, PeaksAtOneAndIsNearTheNeuralOne) {
  double peak = 0, at = 0;
  for (double f = 0.1; f < 60; f += 0.01)
    if (contrast_sensitivity(f) > peak) peak = contrast_sensitivity(at = f);
  EXPECT_NEAR(peak, 1, 1e-4);
  EXPECT_NEAR(at, 7.9, 0.1);
  // log10 of the neural sensitivity over that at 8 cycles per degree, measured with fringes that the eye's
  // optics do not blur (Campbell and Green 1965), as it was read off for another program's VSOTF.
  for (const auto& [cpd, log_ratio] : {std::pair{4.0, -0.14},
                                       {16.0, -0.18},
                                       {24.0, -0.48},
                                       {30.0, -0.68},
                                       {40.0, -1.04},
                                       {50.0, -1.55},
                                       {60.0, -2.16}})
    EXPECT_NEAR(std::log10(contrast_sensitivity(cpd) / contrast_sensitivity(8)), log_ratio, 0.3) << cpd;
}

TEST(Refraction, VisualStrehlOfASphericallyAberratedEyeLiesNearTheOthers) {
  const RefractionCriteria rx = refraction_by_wavefront(make_eye("gullstrand"), {}, 12);
  EXPECT_LT(rx.visual_strehl.M_D, rx.paraxial.M_D);
  EXPECT_GT(rx.visual_strehl.M_D, rx.minimum_rms_spot.M_D - 0.3);
  EXPECT_NEAR(rx.visual_strehl.J0_D, 0, 2e-3);
  EXPECT_NEAR(rx.visual_strehl.J45_D, 0, 2e-3);
}

TEST(WavefrontJson, HasTheContractsKeys) {
  const Json json = wavefront_json(measure_wavefront(make_eye("navarro"), {}));
  for (const char* key : {"pupil_mm", "wavelength_nm", "zernike_um", "rms_um", "strehl", "vsotf", "mtf"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_EQ(json["mtf"]["cpd"].size(), json["mtf"]["tangential"].size());
  EXPECT_EQ(json["zernike_um"].size(), 45u);
}

}  // namespace
}  // namespace emmetrope::raytrace
