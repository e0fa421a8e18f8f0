#include "pipeline/eye/optics/plausible_eye.hpp"

#include <gmock/gmock.h>

#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope {
namespace {

TEST(PlausibleEye, SchematicEyesAre) {
  for (const char* name : {"gullstrand", "gullstrand-emsley", "le-grand", "navarro", "escudero-sanz-navarro",
                           "liou-brennan", "atchison:0", "atchison:-10", "arizona", "bennett-rabbetts"})
    EXPECT_EQ(implausible_eye(make_eye(name)), "") << name;
  EyeOptions near;
  near.accommodation_D = 10;
  for (const char* name : {"gullstrand", "navarro"})
    EXPECT_EQ(implausible_eye(make_eye(name, near)), "") << name;
}

TEST(PlausibleEye, InAnotherUnitIsNot) {
  for (const double factor : {0.1, 1 / 25.4, 10.0}) {
    Json json = to_json(make_eye("navarro"));
    for (Json& surface : json["surfaces"])
      for (const char* key : {"position_mm", "radius_mm", "diameter_mm"})
        if (surface.contains(key)) surface[key] = factor * surface[key].get<double>();
    EXPECT_THAT(implausible_eye(eye_from_json(json, ".")), testing::HasSubstr("that its lengths are mm"));
  }
}

}  // namespace
}  // namespace emmetrope
