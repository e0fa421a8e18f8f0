#include "pipeline/report/content/said.hpp"

#include <gtest/gtest.h>

namespace emmetrope::report {
namespace {

TEST(IsSaid, OfWhatStandsThereOfTheSameEye) {
  const std::vector<std::string> sentences{"OD (right): no lens", "OD (right): no cornea",
                                           "the head is rolled"};
  EXPECT_TRUE(is_said("OD (right): no lens", sentences));
  EXPECT_TRUE(is_said("OD (right): no cornea; no lens", sentences));
  EXPECT_TRUE(is_said("OD (right): refused by segmentation: no lens; no cornea", sentences));
  EXPECT_TRUE(is_said("the head is rolled", sentences));
  EXPECT_FALSE(is_said("OS (left): no lens", sentences));
  EXPECT_FALSE(is_said("no lens", sentences));
  EXPECT_FALSE(is_said("OD (right): no lens; no retina", sentences));
  EXPECT_FALSE(is_said("OD (right): no lens", {}));
}

TEST(IsSaid, OfWhatIsPartOfASentence) {
  const std::vector<std::string> whole{"OD (right): no lens; no cornea; no retina"};
  EXPECT_TRUE(is_said("OD (right): refused by segmentation: no lens; no cornea", whole));
}

}  // namespace
}  // namespace emmetrope::report
