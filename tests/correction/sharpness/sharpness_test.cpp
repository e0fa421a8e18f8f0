#include "correction/sharpness/sharpness.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/wavefront/contrast_sensitivity.hpp"

namespace emmetrope::correction {
namespace {

/// A grating of given frequency, contrast and direction on a field of brightness `mean`; pixels of one
/// arcmin.
GreyImage grating(int size, double cycles_per_degree, double direction, double contrast, double mean) {
  GreyImage image{size, size, {}};
  for (int row = 0; row < size; ++row)
    for (int column = 0; column < size; ++column) {
      const double along = (column * std::cos(direction) + row * std::sin(direction)) / 60;
      image.values.push_back(mean * (1 + contrast * std::cos(2 * pi * cycles_per_degree * along)));
    }
  return image;
}

TEST(Sharpness, GradientIsTheDerivative) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> pixel(0.2, 1);
  for (const SharpnessCriterion criterion : all_criteria) {
    const SharpnessMeasure sharpness(criterion, 12, 10, 1.3, 0.8);
    GreyImage image{12, 10, {}}, direction{12, 10, {}};
    for (int i = 0; i < 120; ++i) {
      image.values.push_back(pixel(random));
      direction.values.push_back(pixel(random) - 0.6);
    }
    double slope = 0;
    const auto energy = sharpness(image);
    for (int i = 0; i < 120; ++i) slope += energy.gradient.values[i] * direction.values[i];
    const double step = 1e-5;
    GreyImage ahead = image, behind = image;
    for (int i = 0; i < 120; ++i) {
      ahead.values[i] += step * direction.values[i];
      behind.values[i] -= step * direction.values[i];
    }
    const double numeric = (sharpness(ahead).value - sharpness(behind).value) / (2 * step);
    EXPECT_NEAR(slope, numeric, 1e-6 * std::abs(numeric) + 1e-12) << to_string(criterion);
  }
}

TEST(Sharpness, BrightnessDoesNotCountAndContrastDoesSquared) {
  for (const SharpnessCriterion criterion : all_criteria) {
    const SharpnessMeasure sharpness(criterion, 128, 128, 1, 1);
    const double reference = sharpness(grating(128, 6, 0.3, 0.4, 1)).value;
    EXPECT_NEAR(sharpness(grating(128, 6, 0.3, 0.4, 7.5)).value, reference, 1e-9 * reference);
    EXPECT_NEAR(sharpness(grating(128, 6, 0.3, 0.2, 1)).value, reference / 4, 0.02 * reference);
    EXPECT_NEAR(sharpness(grating(128, 6, 0.3, 0, 1)).value, 0, 1e-12 * reference);
  }
}

TEST(Sharpness, AllDirectionsCountAlike) {
  for (const SharpnessCriterion criterion : all_criteria) {
    const SharpnessMeasure sharpness(criterion, 128, 128, 1, 1);
    const double reference = sharpness(grating(128, 6, 0, 0.4, 1)).value;
    for (const double direction : {0.2, 0.7, 1.2, 2.0, 2.9})
      EXPECT_NEAR(sharpness(grating(128, 6, direction, 0.4, 1)).value, reference, 0.02 * reference);
  }
}

TEST(Sharpness, WeightsAreThoseOfTheirFormulas) {
  const auto ratio = [](SharpnessCriterion criterion) {  // of two gratings at 4 and 8 cycles per degree
    const SharpnessMeasure sharpness(criterion, 240, 240, 1, 0);
    return sharpness(grating(240, 8, 0, 0.4, 1)).value / sharpness(grating(240, 4, 0, 0.4, 1)).value;
  };
  EXPECT_NEAR(ratio(SharpnessCriterion::gradient_energy), 4, 0.15);
  EXPECT_NEAR(ratio(SharpnessCriterion::laplacian_variance), 16, 1.5);
  const double csf = raytrace::contrast_sensitivity(8) / raytrace::contrast_sensitivity(4);
  EXPECT_NEAR(ratio(SharpnessCriterion::mtf_weighted), 8 * csf * csf, 0.4);
}

TEST(Sharpness, RefusesBlackPicturesAndUnknownNames) {
  EXPECT_THROW(
      SharpnessMeasure(SharpnessCriterion::gradient_energy, 8, 8, 1, 1)({8, 8, std::vector<double>(64, 0.0)}),
      Error);
  EXPECT_THROW(criterion_from_string("sharp"), Error);
  for (const SharpnessCriterion criterion : all_criteria)
    EXPECT_EQ(criterion_from_string(to_string(criterion)), criterion);
}

}  // namespace
}  // namespace emmetrope::correction
