// Charts and scene files.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <numeric>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/scene/chart.hpp"
#include "raytrace/scene/optotypes.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

/// Share of ink in [-3, 3]^2 times its area.
template <typename Ink>
double ink_area(const Ink& ink) {
  constexpr int n = 1200;
  int count = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) count += ink(-3 + 6 * (i + 0.5) / n, -3 + 6 * (j + 0.5) / n);
  return 36.0 * count / n / n;
}

TEST(Optotypes, HaveTheirDefinedAreas) {
  // Ring between radii 1.5 and 2.5 less the gap: the strip |v| < 1/2 between the two arcs.
  const auto arc = [](double r) { return std::sqrt(r * r - 0.25) / 2 + r * r * std::asin(0.5 / r); };
  const double ring = pi * (2.5 * 2.5 - 1.5 * 1.5) - (arc(2.5) - arc(1.5));
  for (const double gap : {0.0, 45.0, 270.0})
    EXPECT_NEAR(ink_area([&](double x, double y) { return landolt_ink(x, y, gap); }), ring, 0.02);
  for (const double open : {0.0, 90.0, 180.0, 270.0})
    EXPECT_NEAR(ink_area([&](double x, double y) { return tumbling_e_ink(x, y, open); }), 17, 0.02);
  EXPECT_NEAR(ink_area([](double x, double y) { return sloan_ink('H', x + 2.5, y + 2.5); }), 13, 0.02);
  for (const char letter : std::string(sloan_letters)) {
    const double area = ink_area([&](double x, double y) { return sloan_ink(letter, x + 2.5, y + 2.5); });
    EXPECT_GT(area, 8) << letter;
    EXPECT_LT(area, 17) << letter;
  }
}

// The chart is 2 tan(10.5 deg) / tan(1') = 1274.3 minutes wide; the largest row takes 9.8 letters of that, 26.0 minutes a
// stroke; the smallest letters are above 5 minutes high.
TEST(Charts, TellTheAcuityOfTheirRows) {
  const auto logmar = logmar_of_rows(parse_chart("letters"));
  ASSERT_EQ(logmar.size(), 15U);
  EXPECT_NEAR(logmar.front(), std::log10(1274.3 / 9.8 / 5), 1e-4);
  for (std::size_t row = 1; row < logmar.size(); ++row) EXPECT_NEAR(logmar[row - 1] - logmar[row], 0.1, 1e-9);
  EXPECT_EQ(logmar_of_rows(parse_chart("landolt:logmar=0.3")), std::vector<double>{0.3});
  EXPECT_TRUE(logmar_of_rows(parse_chart("dial")).empty());
}

TEST(Charts, AreDrawnAtTheirAngle) {
  // A point of logMAR 1: a disc of 10 minutes of arc.
  const Scene scene = draw_chart(parse_chart("point:logmar=1,distance_mm=2000,extent_deg=1"));
  const TexturedPlane& plane = scene.planes.front();
  const double light = std::accumulate(plane.texture->values.begin(), plane.texture->values.end(), 0.0) /
                       plane.texture->values.size();
  const double area_mm2 = light * 4 * plane.right_mm.norm() * plane.up_mm.norm();
  const double diameter_mm = 10 * std::tan(degree / 60) * 2000;
  EXPECT_NEAR(area_mm2 / (pi * diameter_mm * diameter_mm / 4), 1, 0.01);
  EXPECT_NEAR(plane.centre_mm.z(), 2000, 1e-9);
  EXPECT_TRUE(draw_chart(parse_chart("dial:distance_mm=inf")).planes.front().at_infinity);
}

// A point of logMAR 1 on a plane three times as wide as high, and on one as much higher: a disc of 10 minutes of arc
// both ways.
TEST(Charts, KeepTheirAnglesOnAPlaneThatIsNotSquare) {
  ChartSpec spec = parse_chart("point:logmar=1,distance_mm=2000,extent_deg=1");
  for (const Eigen::Vector2d& shown : {Eigen::Vector2d(1, 1.0 / 3), {1.0 / 3, 1}}) {
    const TexturedPlane plane = draw_chart(spec, shown).planes.front();
    const Texture& texture = *plane.texture;
    EXPECT_NEAR(plane.right_mm.norm() / plane.up_mm.norm(), shown.x() / shown.y(), 1e-12);
    Eigen::Vector2d widest_mm(0, 0);  // of all rows, of all columns
    const Eigen::Vector2d texel_mm(2 * plane.right_mm.norm() / texture.width,
                                   2 * plane.up_mm.norm() / texture.height);
    for (int row = 0; row < texture.height; ++row) {
      double sum = 0;
      for (int column = 0; column < texture.width; ++column)
        sum += texture.values[row * texture.width + column];
      widest_mm.x() = std::max(widest_mm.x(), sum * texel_mm.x());
    }
    for (int column = 0; column < texture.width; ++column) {
      double sum = 0;
      for (int row = 0; row < texture.height; ++row) sum += texture.values[row * texture.width + column];
      widest_mm.y() = std::max(widest_mm.y(), sum * texel_mm.y());
    }
    const double diameter_mm = 10 * std::tan(degree / 60) * 2000;
    EXPECT_NEAR(widest_mm.x(), diameter_mm, 0.02 * diameter_mm);
    EXPECT_NEAR(widest_mm.y(), diameter_mm, 0.02 * diameter_mm);
  }
  // It is the middle of the whole chart, of 64 x 64 texels.
  spec.name = "siemens";
  const auto whole = draw_chart(spec).planes.front().texture,
             half = draw_chart(spec, {1, 0.5}).planes.front().texture;
  ASSERT_EQ(half->width, whole->width);
  ASSERT_EQ(2 * half->height, whole->height);
  const auto first = whole->values.begin() + static_cast<std::ptrdiff_t>(whole->width) * (whole->height / 4);
  EXPECT_TRUE(std::equal(half->values.begin(), half->values.end(), first));
}

TEST(Charts, APlaneOfNearly180DegreesHasTheFinestTexture) {
  for (const char* name : {"dial", "letters"}) {
    ChartSpec spec;
    spec.name = name;
    spec.logmar_given = true;
    spec.extent_deg =
        180 - 1e-13;  // of a plane of a scene file, in texels and letters more than an int holds
    EXPECT_EQ(draw_chart(spec).planes.front().texture->width, 2048);
  }
}

TEST(Charts, AllNamesDrawInkAndPaper) {
  for (const auto& name : chart_names()) {
    const auto texture = draw_chart(parse_chart(name)).planes.front().texture;
    const auto [least, most] = std::minmax_element(texture->values.begin(), texture->values.end());
    EXPECT_EQ(*least, 0) << name;
    EXPECT_EQ(*most, 1) << name;
  }
  EXPECT_EQ(make_scene("cards") != nullptr, true);
}

ExitStatus status_of(const std::string& scene) {
  try {
    make_scene(scene);
  } catch (const Error& error) {
    return error.status();
  }
  return ExitStatus::done;
}

TEST(Charts, BadRequestsAreUsageErrors) {
  for (const char* bad :
       {"leters", "letters:logmar", "letters:logmar=x", "letters:size=3", "letters:logmar=9",
        "dial:distance_mm=-5", "letters:spokes=12", "letters:logmar=1,logmar=1"})
    EXPECT_EQ(status_of(bad), ExitStatus::usage) << bad;
}

TEST(Charts, ScenesWithoutKeysSaySo) {
  for (const std::string name : {"cards", "pyramids"}) {
    try {
      make_scene(name + ":logmar=1");
      ADD_FAILURE() << name;
    } catch (const Error& error) {
      EXPECT_EQ(error.status(), ExitStatus::usage);
      EXPECT_NE(std::string(error.what()).find("takes no keys"), std::string::npos) << error.what();
    }
  }
}

TEST(SceneFile, IsReadAndChecked) {
  const auto folder =
      std::filesystem::path(testing::TempDir()) / ("emmetrope-scene-test-" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  const auto file = (folder / "scene.json").string();
  const std::string good =
      R"({"name": "two", "background": [0.2, 0.2, 0.2], "objects": [)"
      R"({"type": "plane", "centre_mm": [0, 0, 400], "right_mm": [-40, 0, 0], "up_mm": [0, 40, 0], "chart": "landolt:logmar=1"}]})";
  write_file(file, good);
  EXPECT_EQ(status_of(file), ExitStatus::done);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    write_file(file, text);
    return status_of(file);
  };
  EXPECT_EQ(changed("\"up_mm\"", "\"upp_mm\""), ExitStatus::input_invalid);
  EXPECT_EQ(changed("[0, 40, 0]", "[0, 40]"), ExitStatus::input_invalid);
  EXPECT_EQ(changed("[0, 40, 0]", "[-1, 0, 0]"), ExitStatus::input_invalid);
  EXPECT_EQ(changed("\"chart\": \"landolt:logmar=1\"", "\"picture\": \"missing.png\""),
            ExitStatus::input_invalid);
  // In metres, within the eye, through it; and what the plane says itself.
  EXPECT_EQ(changed("[0, 0, 400]", "[0, 0, 0.4]"), ExitStatus::input_invalid);
  EXPECT_EQ(changed("[0, 0, 400]", "[0, 0, 19]"), ExitStatus::input_invalid);
  EXPECT_EQ(changed("[0, 0, 400]", "[0, 0, 21]"), ExitStatus::done);
  EXPECT_EQ(changed("\"chart\"", "\"motion_mm\": [0, 0, 770], \"chart\""), ExitStatus::input_invalid);
  EXPECT_EQ(changed("\"chart\"", "\"motion_mm\": [0, 0, 750], \"chart\""), ExitStatus::done);
  EXPECT_EQ(changed("logmar=1", "logmar=1,distance_mm=6000"), ExitStatus::input_invalid);
  EXPECT_EQ(changed("logmar=1", "logmar=1,extent_deg=5"), ExitStatus::input_invalid);
  // A chart's own faults are the file's, and named with it.
  EXPECT_EQ(changed("landolt:", "landoldt:"), ExitStatus::input_invalid);
  EXPECT_EQ(changed("logmar=1", "foo=1"), ExitStatus::input_invalid);
  EXPECT_EQ(changed("logmar=1", "logmar=9"), ExitStatus::input_invalid);
  try {
    make_scene(file);
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), file + ": objects[0]: key \"chart\": logmar=9 is out of range");
    EXPECT_EQ(error.remedy(), "give -1 to 3");
  }
  // Landolt rings of a card twice as high as wide: as many texels a millimetre both ways.
  EXPECT_EQ(changed("[0, 40, 0]", "[0, 80, 0]"), ExitStatus::done);
  const auto card = make_scene(file)->planes.front().texture;
  EXPECT_NEAR(card->height, 2 * card->width, 1);
  std::filesystem::remove_all(folder);
}

// Of directions, too, the angle is that between the lines of sight, 11 degrees here, and not that of tangents on a
// plane ahead: a dial 37 degrees aside has the strokes of one straight ahead.
TEST(SceneFile, AChartIsDrawnForItsAngleWhereverItStands) {
  const test::TemporaryFolder folder;
  const auto dial = [&](const char* centre, const char* right, const char* at_infinity) {
    write_file(folder.path() / "scene.json",
               fmt::format(R"({{"objects": [{{"type": "plane", "chart": "dial:logmar=1", "at_infinity": {}, )"
                           R"("centre_mm": {}, "right_mm": {}, "up_mm": [0, 50, 0]}}]}})",
                           at_infinity, centre, right));
    return make_scene((folder.path() / "scene.json").string())->planes.front().texture->values;
  };
  const auto ahead = dial("[0, 0, 500]", "[-50, 0, 0]", "true");
  EXPECT_TRUE(dial("[300, 0, 400]", "[-40, 0, 30]", "true") == ahead);
  EXPECT_TRUE(dial("[300, 0, 400]", "[-40, 0, 30]", "false") == ahead);
}

/// The square of such a length is no number, and the chart's size in texels was none (found by fuzzing).
TEST(SceneFile, APlaneBeyondTheStarsIsRefused) {
  const test::TemporaryFolder folder;
  const std::string file = (folder.path() / "scene.json").string();
  for (const auto& [right, is_drawn] : {std::pair{"-3e307", false}, {"1e16", false}, {"-3e7", true}}) {
    write_file(file,
               fmt::format(R"({{"objects": [{{"type": "plane", "chart": "letters:logmar=0.5", )"
                           R"("centre_mm": [0, 0, 400], "right_mm": [{}, 0, 0], "up_mm": [0, 20, 0]}}]}})",
                           right));
    try {
      make_scene(file);
      EXPECT_TRUE(is_drawn) << right;
    } catch (const Error& error) {
      EXPECT_FALSE(is_drawn) << right;
      EXPECT_NE(std::string(error.what()).find("right_mm"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
