#include "pipeline/base/ends_with.hpp"

#include <gtest/gtest.h>

namespace emmetrope {
namespace {

TEST(EndsWith, LooksAtTheEndAlone) {
  EXPECT_TRUE(ends_with("radius_mm", "_mm"));
  EXPECT_TRUE(ends_with("_mm", "_mm"));
  EXPECT_TRUE(ends_with("radius", ""));
  EXPECT_FALSE(ends_with("radius_mm_low", "_mm"));
  EXPECT_FALSE(ends_with("mm", "_mm"));
}

}  // namespace
}  // namespace emmetrope
