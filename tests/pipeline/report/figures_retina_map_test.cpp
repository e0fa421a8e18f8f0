#include <gtest/gtest.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/process.hpp"
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

/// Where a label of one letter stands in an SVG, in pixels from the left.
double place_of(const std::string& svg, const std::string& letter) {
  const std::size_t label = svg.find(">" + letter + "<"), place = svg.rfind("translate(", label);
  return std::stod(svg.substr(place + std::string("translate(").size()));
}

/// The picture of heights, which lies over the grey one; BGRA.
cv::Mat heights_in(const std::string& svg) {
  const std::string before = "base64,";
  const std::size_t begin = svg.rfind(before) + before.size();
  std::string text = svg.substr(begin, svg.find('\'', begin) - begin);
  text.erase(std::remove_if(text.begin(), text.end(), [](unsigned char c) { return std::isspace(c); }),
             text.end());
  std::vector<unsigned char> bytes(text.size());
  const int length = EVP_DecodeBlock(bytes.data(), reinterpret_cast<const unsigned char*>(text.data()),
                                     static_cast<int>(text.size()));
  bytes.resize(static_cast<std::size_t>(length));
  return cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
}

/// Outward is red and drawn, where the height is sure, on its own side: here the patient's left, the figure's right.
TEST(RetinaMap, IsDrawnAsTheExaminerSeesIt) {
  if (!find_program("gnuplot")) GTEST_SKIP() << "gnuplot is not installed";
  Json retina = tilted();
  for (Json& ring : retina["map"]["height_half_ci95_mm"])
    for (Json& half : ring) half = 20;
  const auto map = read_retina_map(retina);
  ASSERT_TRUE(map);
  for (const bool is_right_eye : {true, false}) {
    Figure figure;
    figure.id = "map";
    figure.width_px = 400;
    figure.height_px = 300;
    ASSERT_TRUE(draw_retina_map(figure, *map, 80, is_right_eye));
    EXPECT_EQ(place_of(figure.svg, "T") < place_of(figure.svg, "N"), is_right_eye);
    const cv::Mat picture = heights_in(figure.svg);
    ASSERT_EQ(picture.channels(), 4);
    const auto at = [&](double x, double y) {  // in reaches from the middle, to the right and up
      return picture.at<cv::Vec4b>(static_cast<int>((0.5 - y / 2) * (picture.rows - 1)),
                                   static_cast<int>((0.5 + x / 2) * (picture.cols - 1)));
    };
    EXPECT_GT(at(0.8, 0.3)[2], at(0.8, 0.3)[0] + 50);      // red
    EXPECT_GT(at(-0.8, -0.3)[0], at(-0.8, -0.3)[2] + 50);  // blue
    EXPECT_EQ(at(0.8, 0.3)[3], 255);
    EXPECT_EQ(at(0.1, 0)[3], 0);    // within its interval
    EXPECT_EQ(at(0.9, 0.9)[3], 0);  // beyond the map
  }
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
  Json bare = tilted();
  bare["map"].erase("height_half_ci95_mm");
  EXPECT_FALSE(read_retina_map(bare));
  Json alone = tilted();
  alone["map"]["eccentricity_deg"] = {0};
  EXPECT_FALSE(read_retina_map(alone));
}

}  // namespace
}  // namespace emmetrope::report
