#include "segmentation/intake/same_acquisition.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace emmetrope::segmentation {
namespace {

/// A ball in noise of its own.
Stack ball(unsigned seed) {
  constexpr int columns = 40, rows = 36, slices = 20;
  Stack stack;
  stack.columns = columns;
  stack.rows = rows;
  stack.along_row = {1, 0, 0};
  stack.along_column = {0, 1, 0};
  stack.normal = {0, 0, 1};
  stack.column_spacing_mm = stack.row_spacing_mm = stack.slice_thickness_mm = 1;
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0, 3);
  for (int s = 0; s < slices; ++s) {
    stack.slice_position.emplace_back(0, 0, s);
    stack.slice_intensity.emplace_back();
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c)
        stack.slice_intensity.back().push_back((std::hypot(c - 20, r - 18, s - 10) < 9 ? 200.0F : 100.0F) +
                                               noise(random));
  }
  return stack;
}

TEST(SameAcquisition, IsOneWhateverWasDoneToItsBrightness) {
  const Stack acquired = ball(1);
  Stack made_even = acquired;
  for (std::vector<float>& slice : made_even.slice_intensity)
    for (std::size_t i = 0; i < slice.size(); ++i)
      slice[i] = std::round(0.7F * slice[i] * (1 + 0.004F * static_cast<float>(i % 40)));
  EXPECT_TRUE(is_same_acquisition(acquired, made_even));
  made_even.slice_position.front().x() += 0.1;
  EXPECT_FALSE(is_same_acquisition(acquired, made_even));
}

TEST(SameAcquisition, TwoOfOneHeadAreTwo) { EXPECT_FALSE(is_same_acquisition(ball(1), ball(2))); }

}  // namespace
}  // namespace emmetrope::segmentation
