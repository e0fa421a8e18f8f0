#include "segmentation/finding/shared_noise.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// A cube of 1 mm voxels about the origin, brighter to one side as by a coil.
Stack vitreous(const std::function<double(const Vector3d&)>& value) {
  Stack stack;
  stack.columns = stack.rows = 21;
  stack.along_row = Vector3d::UnitX();
  stack.along_column = Vector3d::UnitY();
  stack.normal = Vector3d::UnitZ();
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 1;
  for (int s = -10; s <= 10; ++s) {
    stack.slice_position.emplace_back(-10, -10, s);
    std::vector<float> slice;
    for (int r = -10; r <= 10; ++r)
      for (int c = -10; c <= 10; ++c) slice.push_back(static_cast<float>(value(Vector3d(c, r, s))));
    stack.slice_intensity.push_back(slice);
  }
  return stack;
}

Stack acquired(unsigned seed, double noise, double texture = 0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  return vitreous([&](const Vector3d& x) {
    return 100 + 0.5 * x.y() + texture * std::sin(1.5 * x.x()) * std::sin(1.3 * x.z()) + normal(random);
  });
}

/// Means over voxels about each place, which weigh as a Gaussian of this width.
Stack smoothed(const Stack& stack, double sigma_mm) {
  const Sampler sampler(stack);
  return vitreous([&](const Vector3d& x) {
    double sum = 0, weights = 0;
    for (int i = -2; i <= 2; ++i)
      for (int j = -2; j <= 2; ++j)
        for (int k = -2; k <= 2; ++k) {
          const Vector3d d(i, j, k);
          const double weight = std::exp(-d.squaredNorm() / (2 * sigma_mm * sigma_mm));
          const auto value = sampler.interpolate(x + d);
          if (!value) continue;
          sum += weight * *value;
          weights += weight;
        }
    return sum / weights;
  });
}

const std::vector<Vector3d> middle{Vector3d::Zero()};

using Copies = std::map<std::size_t, std::size_t>;

/// Of stacks that show the globe in the middle.
Copies stored_again(const std::vector<Stack>& stacks) {
  std::vector<StackOfGlobes> compared;
  for (const Stack& stack : stacks) compared.push_back({&stack, middle});
  return find_stored_again(compared);
}

TEST(SharedNoise, IsWhatItsDeviationSays) {
  const Stack image = acquired(1, 5);
  const VitreousNoise noise = compare_noise(image, {&image}, middle);
  EXPECT_NEAR(noise.relative, 0.05,
              0.004);  // of 389 voxels, 3.6 % one standard deviation, less ten that are fitted
  EXPECT_NEAR(noise.correlation, 1, 1e-9);
}

TEST(SharedNoise, OfTwoAcquisitionsIsNone) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Stack a = acquired(2 * seed, 5), b = acquired(2 * seed + 1, 5);
    EXPECT_LT(compare_noise(a, {&b}, middle).correlation, 0.25);  // five standard deviations
    EXPECT_EQ(stored_again({a, b}), Copies{});
  }
}

/// Opacities are the same in both images; as strong as the noise they make correlations of a half.
TEST(SharedNoise, OfTwoAcquisitionsOfATexturedVitreousIsNone) {
  const Stack a = acquired(1, 4, 8), b = acquired(2, 4, 8);  // the root mean square of the texture is 4
  EXPECT_GT(compare_noise(a, {&b}, middle).correlation, 0.3);
  EXPECT_EQ(stored_again({a, b}), Copies{});
}

TEST(SharedNoise, OfOneAcquisitionIsKnownWhenItIsScaledSmoothedAndCut) {
  const Stack image = acquired(3, 5), other = acquired(4, 5);
  const Sampler sampler(image);
  const Stack normalised = vitreous([&](const Vector3d& x) {
    return (3 + 0.1 * x.y() + 0.01 * x.z() * x.z()) * sampler.interpolate(x).value_or(0);
  });
  Stack half_a_voxel_off =
      vitreous([&](const Vector3d& x) { return sampler.interpolate(x + Vector3d(0, 0, 0.5)).value_or(0); });
  for (Vector3d& position : half_a_voxel_off.slice_position) position.z() += 0.5;
  EXPECT_EQ(stored_again({image, other, normalised}).size(), 1U);
  EXPECT_EQ(stored_again({smoothed(image, 0.45), other, image}), (Copies{{0, 2}}));
  EXPECT_EQ(stored_again({image, half_a_voxel_off}), (Copies{{1, 0}}));
  EXPECT_EQ(stored_again({half_a_voxel_off, other, image}), (Copies{{0, 2}}));
}

/// The last one is too smooth to be like the first.
TEST(SharedNoise, ACopyOfACopyIsOne) {
  const Stack image = acquired(3, 5), once = smoothed(image, 0.5), twice = smoothed(once, 0.65);
  EXPECT_LT(compare_noise(twice, {&image}, middle).correlation, 0.85);
  EXPECT_EQ(stored_again({twice, image, once}), (Copies{{0, 1}, {2, 1}}));
}

TEST(SharedNoise, OfAMeanIsThatOfTheAcquisitionsThatItIsOf) {
  const Stack a = acquired(5, 5), b = acquired(6, 5);
  const Sampler of_a(a), of_b(b);
  const Stack mean = vitreous([&](const Vector3d& x) {
    return (of_a.interpolate(x).value_or(0) + of_b.interpolate(x).value_or(0)) / 2;
  });
  const Copies again = stored_again({mean, a, b});
  ASSERT_EQ(again.size(), 1U);
  EXPECT_EQ(again.begin()->first, 0U);
}

TEST(SharedNoise, OfTwoCopiesTheOneThatShowsMoreEyesStays) {
  const Stack image = acquired(3, 5), copy = smoothed(image, 0.45);
  const std::vector<Vector3d> both{Vector3d(0, 0, 2), Vector3d(0, 0, -2)};
  EXPECT_EQ(find_stored_again({{&image, middle}, {&copy, both}}), (Copies{{0, 1}}));
}

TEST(SharedNoise, IsNotToldOfImagesWithoutNoise) {
  EXPECT_EQ(stored_again({acquired(1, 0, 1), acquired(2, 0, 1)}), Copies{});
  const Stack image = acquired(1, 5);
  const std::vector<Vector3d> outside{Vector3d(40, 0, 0)};
  EXPECT_EQ(find_stored_again({{&image, outside}, {&image, outside}}), Copies{});
}

}  // namespace
}  // namespace emmetrope::segmentation
