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

}  // namespace
}  // namespace emmetrope::phantom
