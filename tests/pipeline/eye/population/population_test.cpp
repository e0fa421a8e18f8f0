#include "pipeline/eye/population/population.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace emmetrope {
namespace {

TEST(LensIndexAtAge, IsTheLineWhereLensesWereMeasured) {
  for (const double age_years : {18.0, 40.0, 70.0}) {
    EXPECT_NEAR(lens_index_at_age(age_years).mean, 1.441 - 0.00039 * age_years, 1e-12) << age_years;
    EXPECT_EQ(lens_index_at_age(age_years).sigma, 0.005) << age_years;
  }
}

TEST(LensIndexAtAge, IsLessKnownBeyond) {
  for (const auto& [age_years, end_years] : {std::pair(0.0, 18.0), {100.0, 70.0}, {110.0, 70.0}}) {
    const LensIndex index = lens_index_at_age(age_years);
    const double line_adds = -0.00039 * (age_years - end_years);
    EXPECT_NEAR(index.mean, 1.441 - 0.00039 * age_years, 1e-12) << age_years;
    EXPECT_NEAR(index.sigma, std::hypot(0.005, line_adds), 1e-12) << age_years;
    EXPECT_GT(1.96 * index.sigma, std::abs(line_adds)) << age_years;  // it holds the nearer end
  }
}

}  // namespace
}  // namespace emmetrope
