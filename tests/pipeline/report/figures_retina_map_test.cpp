#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/report/figures/retina_map.hpp"

namespace emmetrope::report {
namespace {

/// Heights x + 0.5 y of the place in the map, 60 degrees from the pole to the rim.
Json tilted() {
  Json map{
      {"eccentricity_deg", Json::array()}, {"meridian_deg", Json::array()}, {"height_mm", Json::array()}};
  for (int m = 0; m < 12; ++m) map["meridian_deg"].push_back(30 * m);
  for (int e = 0; e < 7; ++e) {
    map["eccentricity_deg"].push_back(10 * e);
    Json ring = Json::array();
    for (int m = 0; m < (e == 0 ? 1 : 12); ++m)
      ring.push_back(10 * e * (std::cos(30 * m * degree) + 0.5 * std::sin(30 * m * degree)));
    map["height_mm"].push_back(ring);
  }
  map["height_half_ci95_mm"] = map["height_mm"];
  return {{"map", map}};
}

TEST(RetinaMap, IsSmoothThroughItsHeightsAndThePole) {
  const auto map = read_retina_map(tilted());
  ASSERT_TRUE(map);
  EXPECT_EQ(map->reach_deg(), 60);
  EXPECT_NEAR(map->largest_height_mm(), 60 * std::cos(30 * degree) + 30 * std::sin(30 * degree), 1e-9);
  for (const double eccentricity : {0.0, 4.0, 20.0, 37.0, 60.0})
    for (const double meridian : {0.0, 30.0, 143.0, 270.0, 359.0}) {
      const double plane = eccentricity * (std::cos(meridian * degree) + 0.5 * std::sin(meridian * degree));
      // Catmull-Rom's error of a sine at 30 degrees' distance.
      EXPECT_NEAR(map->at(map->height_mm, eccentricity, meridian), plane, 0.006 * eccentricity + 1e-9)
          << eccentricity << " " << meridian;
    }
  for (int m = 0; m < 12; ++m)
    EXPECT_NEAR(map->at(map->height_mm, 30, 30 * m), map->height_mm[3][static_cast<std::size_t>(m)], 1e-9);
}

TEST(RetinaMap, WhatIsNoMapIsNone) {
  EXPECT_FALSE(read_retina_map(Json()));
  EXPECT_FALSE(read_retina_map({{"map", {{"withheld", "no fit"}}}}));
  Json short_ring = tilted();
  short_ring["map"]["height_mm"][3].erase(0);
  EXPECT_FALSE(read_retina_map(short_ring));
  Json uneven = tilted();
  uneven["map"]["meridian_deg"][4] = 121;
  EXPECT_FALSE(read_retina_map(uneven));
  Json alone = tilted();
  alone["map"]["eccentricity_deg"] = {0};
  EXPECT_FALSE(read_retina_map(alone));
}

}  // namespace
}  // namespace emmetrope::report
