#include "pipeline/base/case_subject.hpp"

#include <gtest/gtest.h>

namespace emmetrope {
namespace {

TEST(AgeWarning, SaysWhereAnAgeIsNotTheStudys) {
  EXPECT_EQ(age_warning(64, 30), "the age that was given, 30 years, is not used: the study says 64 years");
  EXPECT_EQ(age_warning(64, 64.7), "") << "a header's are whole years";
  EXPECT_EQ(age_warning({}, 30), "");
  EXPECT_EQ(age_warning(64, {}), "");
}

}  // namespace
}  // namespace emmetrope
