#include "pipeline/base/iso_date.hpp"

#include <gtest/gtest.h>

namespace emmetrope {
namespace {

TEST(IsoDate, IsThatOfADayOfTheCalendar) {
  EXPECT_EQ(iso_date("20260314"), "2026-03-14");
  EXPECT_EQ(iso_date("20240229"), "2024-02-29");
  EXPECT_EQ(iso_date("20000229"), "2000-02-29");
  for (const char* none :
       {"", "20261399", "20260014", "20260300", "20260431", "20230229", "19000229", "00000101", "2026031",
        "202603140", "2026.01.01", "2026-3-4", " 2026314", "+2026314"})
    EXPECT_EQ(iso_date(none), "") << none;
}

}  // namespace
}  // namespace emmetrope
