#include "pipeline/base/case_scans.hpp"

#include <gtest/gtest.h>

namespace emmetrope {
namespace {

Json case_of(double mean) {
  return {{"subject", {{"age_years", 40}}},
          {"series",
           {{{"name", "stack1"},
             {"uid", "1.2.3"},
             {"columns", 208},
             {"rows", 208},
             {"slices", 16},
             {"min", 0.0},
             {"max", 1492.0},
             {"mean", mean}}}},
          {"stacks", {{{"name", "stack1"}, {"used", true}}}}};
}

TEST(CaseScans, AreToldByTheirVoxelsNotByTheirHeaders) {
  const Json scan = case_of(200.11191319572856);
  Json copy = scan;
  copy["subject"]["age_years"] = 41;
  copy["series"][0]["uid"] = "1.2.4";
  EXPECT_TRUE(share_a_scan(scan, copy));
  EXPECT_FALSE(share_a_scan(scan, case_of(200.11191319572859)));
}

TEST(CaseScans, OfWhatWasNotUsedOrIsNotToldAreNone) {
  Json scan = case_of(200);
  scan["stacks"][0]["used"] = false;
  EXPECT_TRUE(used_scans(scan).empty());
  Json untold = case_of(200);
  untold["series"][0]["mean"] = nullptr;
  EXPECT_TRUE(used_scans(untold).empty());
  EXPECT_TRUE(used_scans(Json::object()).empty());
}

}  // namespace
}  // namespace emmetrope
