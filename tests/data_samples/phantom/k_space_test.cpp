// The Fourier part of the scanner against signals whose images are known.
#include "data_samples/phantom/k_space.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

constexpr int size = 64;

/// Cell averages of 10 + cos(2 pi cycles x / size + phase), x in pixels from the first pixel's centre.
FineSlice cosine(double cycles, double phase, bool fat = false) {
  FineSlice slice;
  slice.columns = slice.rows = size;
  slice.water.assign(std::size_t{fine} * fine * size * size, 0);
  slice.fat = slice.water;
  auto& target = fat ? slice.fat : slice.water;
  const double k = 2 * pi * cycles / size;
  for (int j = 0; j < fine * size; ++j)
    for (int i = 0; i < fine * size; ++i) {
      const double left = static_cast<double>(i) / fine - 0.5;
      const double right = static_cast<double>(i + 1) / fine - 0.5;
      target[static_cast<std::size_t>(j) * fine * size + i] =
          10 + fine * (std::sin(k * right + phase) - std::sin(k * left + phase)) / k;
    }
  return slice;
}

TEST(KSpace, WhatIsBelowNyquistIsSampledExactly) {
  for (const double cycles : {1.0, 7.0, 31.0}) {
    const auto image = magnitude_image(cosine(cycles, 0.3), {});
    for (int i = 0; i < size; ++i)
      EXPECT_NEAR(image[5 * size + i], 10 + std::cos(2 * pi * cycles * i / size + 0.3), 1e-5)
          << cycles << " " << i;
  }
}

TEST(KSpace, WhatIsNotAcquiredIsGone) {
  KSpace half;
  half.acquired_readout = 0.5;
  const auto beyond = magnitude_image(cosine(17, 0.3), half);
  const auto within = magnitude_image(cosine(15, 0.3), half);
  for (int i = 0; i < size; ++i) {
    EXPECT_NEAR(beyond[i], 10, 1e-5);
    EXPECT_NEAR(within[i], 10 + std::cos(2 * pi * 15 * i / size + 0.3), 1e-5);
  }
  const auto aliased = magnitude_image(cosine(40, 0.3), {});
  for (int i = 0; i < size; ++i) EXPECT_NEAR(aliased[i], 10, 1e-5);
}

TEST(KSpace, FatMovesAlongTheRows) {
  KSpace shifted;
  shifted.fat_shift_px = 1.5;
  const auto fat = magnitude_image(cosine(3, 0, true), shifted);
  const auto water = magnitude_image(cosine(3, 0, false), shifted);
  for (int i = 0; i < size; ++i) {
    EXPECT_NEAR(fat[i], 10 + std::cos(2 * pi * 3 * (i - 1.5) / size), 1e-5);
    EXPECT_NEAR(water[i], 10 + std::cos(2 * pi * 3 * i / size), 1e-5);
  }
}

FineSlice constant(double value) {
  FineSlice slice;
  slice.columns = slice.rows = 128;
  slice.water.assign(static_cast<std::size_t>(fine) * fine * 128 * 128, value);
  slice.fat.assign(slice.water.size(), 0);
  return slice;
}

struct Moments {
  double mean, sd;
};
Moments moments(const std::vector<float>& image) {
  const double n = static_cast<double>(image.size());
  const double mean = std::accumulate(image.begin(), image.end(), 0.0) / n;
  double square = 0;
  for (const float value : image) square += (value - mean) * (value - mean);
  return {mean, std::sqrt(square / (n - 1))};
}

TEST(KSpace, NoiseIsRician) {
  for (const double acquired : {1.0, 0.6}) {
    KSpace noisy;
    noisy.sigma = 5;
    noisy.acquired_phase = acquired;
    noisy.seed = 42;
    // Air: Rayleigh. 16384 pixels (fewer independent ones where k-space is not full): 3 % is more than 4
    // sigma.
    const Moments air = moments(magnitude_image(constant(0), noisy));
    EXPECT_NEAR(air.mean, 5 * std::sqrt(pi / 2), 0.03 * 5);
    EXPECT_NEAR(air.sd, 5 * std::sqrt(2 - pi / 2), 0.03 * 5);
    // Bright: Gaussian of sigma about sqrt(A^2 + sigma^2).
    const Moments bright = moments(magnitude_image(constant(200), noisy));
    EXPECT_NEAR(bright.mean, 200 + 0.5 * 25 / 200, 0.2);
    EXPECT_NEAR(bright.sd, 5, 0.15);
  }
}

/// A Hann window to the edge of k-space: 1/2 + 1/2 cos(pi k / k_max) on a wave of frequency k; of the noise's power in one
/// direction the mean of its square, 3/8, is left.
TEST(KSpace, AWindowSmoothsSignalAndNoiseAlike) {
  KSpace hann;
  hann.window = Window::hann;
  const double cycles = 12, gain = 0.5 + 0.5 * std::cos(pi * cycles / (size / 2));
  const auto image = magnitude_image(cosine(cycles, 0.3), hann);
  for (int i = 0; i < size; ++i)
    EXPECT_NEAR(image[i], 10 + gain * std::cos(2 * pi * cycles * i / size + 0.3), 1e-5) << i;
  hann.sigma = 5;
  EXPECT_NEAR(moments(magnitude_image(constant(200), hann)).sd, 5 * 3.0 / 8, 0.1);
}

/// What moves in step with every third line appears a third of the field of view away, on both sides.
TEST(KSpace, GhostsLieAThirdOfTheFieldOfViewAway) {
  FineSlice slice = constant(0);
  slice.columns = slice.rows = 96;
  slice.water.assign(static_cast<std::size_t>(fine) * fine * 96 * 96, 0);
  slice.fat = slice.water;
  for (int j = 0; j < fine * 96; ++j)
    for (int i = 0; i < fine * 96; ++i)
      if (std::abs(j - 48 * fine) < 6 * fine) slice.water[static_cast<std::size_t>(j) * fine * 96 + i] = 100;
  KSpace ghosts;
  ghosts.ghost = 0.05;
  const auto image = magnitude_image(slice, ghosts);
  const auto row = [&](int r) { return image[static_cast<std::size_t>(r) * 96 + 40]; };
  EXPECT_NEAR(row(48), 100, 2);  // a slab rings
  EXPECT_NEAR(row(48 + 32), 5, 0.5);
  EXPECT_NEAR(row(48 - 32), 5, 0.5);
  EXPECT_NEAR(row(48 + 20), 0, 0.5);
}

TEST(KSpace, AnEchoTrainBlursAlongTheColumnsOnly) {
  KSpace train;
  train.echo_train = 1;
  const double cycles = 12, reach = size / 2 - 1;
  FineSlice along_columns = cosine(cycles, 0.3), across = along_columns;
  for (int j = 0; j < fine * size; ++j)
    for (int i = 0; i < fine * size; ++i)
      across.water[static_cast<std::size_t>(i) * fine * size + j] =
          along_columns.water[static_cast<std::size_t>(j) * fine * size + i];
  const auto rows_kept = magnitude_image(along_columns, train),
             columns_blurred = magnitude_image(across, train);
  const double gain = std::exp(-cycles / reach);
  for (int i = 0; i < size; ++i) {
    const double wave = std::cos(2 * pi * cycles * i / size + 0.3);
    EXPECT_NEAR(rows_kept[i], 10 + wave, 1e-5);
    EXPECT_NEAR(columns_blurred[static_cast<std::size_t>(i) * size], 10 + gain * wave, 1e-5);
  }
}

TEST(KSpace, NoiseThatVariesIsStrongestInTheMiddle) {
  KSpace noisy;
  noisy.sigma = 5;
  noisy.noise_variation = 1;
  const auto image = magnitude_image(constant(400), noisy);
  std::vector<float> middle, corner;
  for (int r = 0; r < 16; ++r)
    for (int c = 0; c < 16; ++c) {
      middle.push_back(image[static_cast<std::size_t>(r + 56) * 128 + c + 56]);
      corner.push_back(image[static_cast<std::size_t>(r) * 128 + c]);
    }
  EXPECT_NEAR(moments(middle).sd, 10, 1.5);
  EXPECT_NEAR(moments(corner).sd, 5, 0.8);
}

/// Means over layers of 10 + cos(2 pi cycles z / slices + phase), z in slices from the first one's middle.
double through_slices(const SliceEncoding& encoding, int slices, double cycles, double phase, int slice) {
  const double k = 2 * pi * cycles / slices;
  double sum = 0;
  for (int layer = 0; layer < fine * slices; ++layer) {
    const double below = static_cast<double>(layer) / fine - 0.5,
                 above = static_cast<double>(layer + 1) / fine - 0.5;
    sum += encoding.of_layer(slice, layer) *
           (10 + fine * (std::sin(k * above + phase) - std::sin(k * below + phase)) / k);
  }
  return sum;
}

TEST(SliceEncoding, SamplesWhatIsBelowNyquistExactlyAndNothingBeyond) {
  constexpr int slices = 20;
  const SliceEncoding encoding(slices, Window::none);
  for (int slice = 0; slice < slices; ++slice) {
    for (const double cycles : {1.0, 4.0, 9.0})
      EXPECT_NEAR(through_slices(encoding, slices, cycles, 0.3, slice),
                  10 + std::cos(2 * pi * cycles * slice / slices + 0.3), 1e-9)
          << cycles << " " << slice;
    EXPECT_NEAR(through_slices(encoding, slices, 13, 0.3, slice), 10, 1e-9);
  }
}

TEST(SliceEncoding, WindowsTheSignalAndTheNoise) {
  constexpr int slices = 20;
  const SliceEncoding sharp(slices, Window::none), hann(slices, Window::hann);
  const double half = 0.5 + 0.5 * std::cos(pi * 5 / 10.0);
  EXPECT_NEAR(through_slices(hann, slices, 5, 0.3, 3), 10 + half * std::cos(2 * pi * 5 * 3 / 20.0 + 0.3),
              1e-9);
  const auto variance = [](const SliceEncoding& encoding) {
    double sum = 0;
    for (int of_slice = 0; of_slice < slices; ++of_slice) sum += std::pow(encoding.of_noise(7, of_slice), 2);
    return sum;
  };
  EXPECT_NEAR(variance(sharp), 1, 1e-9);
  // The mean square of the window: 3/8 in the limit of many slices.
  EXPECT_NEAR(variance(hann), 3.0 / 8, 0.02);
}

}  // namespace
}  // namespace emmetrope::phantom
