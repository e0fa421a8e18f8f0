// Pictures through meshes, whose rays are sent in tiles of sixteen pixels, against pictures through the
// formulas.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/retina/retina_pixels.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::raytrace {
namespace {

TraceSettings settings_of(int width, int height, int samples) {
  TraceSettings settings;
  settings.grid = {width, height, 0.012 * width, 0.012 * height, {0, 0}};
  settings.samples = samples;
  settings.verbosity.quiet = true;
  return settings;
}

TEST(Tiles, HoldEveryPixelOnceAndNoNeighbours) {
  for (const auto& [width, height] : {std::pair{37, 21}, {16, 16}, {1, 1}, {5, 40}, {500, 500}, {28, 100}}) {
    const PixelOrder order = in_tiles(width, height);
    std::set<int> seen;
    for (std::size_t item = 0; item < order.items(); ++item)
      for (int a = 0; a < 16; ++a) {
        const int pixel = order.pixels[item * 16 + a];
        if (pixel < 0) continue;
        EXPECT_TRUE(seen.insert(pixel).second);
        for (int b = 0; b < a; ++b) {
          const int other = order.pixels[item * 16 + b];
          if (other < 0) continue;
          EXPECT_GE(
              std::max(std::abs(pixel % width - other % width), std::abs(pixel / width - other / width)), 4);
        }
      }
    EXPECT_EQ(seen.size(), static_cast<std::size_t>(width) * height);
    EXPECT_EQ(*seen.rbegin(), width * height - 1);
  }
}

TEST(Tiles, FewLanesAreWithoutAPixel) {
  for (const auto& [width, height] : {std::pair{500, 500}, {512, 512}, {640, 480}, {100, 301}})
    EXPECT_LT(static_cast<double>(in_tiles(width, height).pixels.size()), 1.011 * width * height);
}

/// A mesh of 3200 vertices lies within 0.02 arcmin of its formula: what is left is the noise of 2048 samples.
void expect_like_formulas(TraceSettings settings, Representation representation) {
  const Tracer tracer("");
  const EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  const auto scene = make_scene("letters:logmar=1,distance_mm=500");
  settings.vertices = {3200};
  const auto formulas = tracer.trace(eye, *scene, settings);
  settings.representation = representation;
  const auto mesh = tracer.trace(eye, *scene, settings);
  double mean = 0, largest = 0;
  for (std::size_t i = 0; i < mesh.image.values.size(); ++i) {
    const double difference = double(mesh.image.values[i]) - formulas.image.values[i];
    mean += difference / static_cast<double>(mesh.image.values.size());
    largest = std::max(largest, std::abs(difference));
  }
  // Illuminance is relative to that of one pixel, of whose rays one in a hundred is stopped, give or take
  // 0.2.
  EXPECT_LT(std::abs(mean), settings.illuminance ? 2e-3 : 5e-4);
  EXPECT_LT(largest, 0.02);
  EXPECT_EQ(mesh.rays, formulas.rays);
  for (const auto& [state, count] : formulas.states)
    EXPECT_NEAR(static_cast<double>(mesh.states.at(state)), static_cast<double>(count),
                1e-3 * static_cast<double>(mesh.rays))
        << to_string(state);
}

TEST(Tiles, SmoothDrawsWhatFormulasDraw) {
  TraceSettings settings = settings_of(37, 21, 2048);
  settings.wavelength_nm = 589.3;
  expect_like_formulas(settings, Representation::smooth);
  settings.illuminance = true;
  expect_like_formulas(settings, Representation::smooth);
}

TEST(Tiles, ColoursToo) { expect_like_formulas(settings_of(21, 37, 2048), Representation::smooth); }

TEST(Tiles, TrianglesDrawWhatFormulasDraw) {
  TraceSettings settings = settings_of(37, 21, 2048);
  settings.wavelength_nm = 589.3;
  expect_like_formulas(settings, Representation::triangles);
}

TEST(Tiles, RaysThatAreNoNumbersAreCountedAndHarmNothing) {
  // A cornea a thousandth of its size throws rays so far that float32 overflows.
  EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  eye.surface("cornea_anterior").shape = std::make_shared<MeshShape>(
      sheet_mesh(*make_conic(0.00772, -0.26), 0.005, 565, 0.25), MeshInterpolation::smooth);
  TraceSettings settings = settings_of(20, 20, 128);
  settings.wavelength_nm = 589.3;
  const auto result = Tracer("").trace(eye, *make_scene("letters:distance_mm=500"), settings);
  std::uint64_t counted = 0;
  for (const auto& [state, count] : result.states) counted += count;
  EXPECT_EQ(counted, result.rays);
  for (const float value : result.image.values) EXPECT_TRUE(value >= 0 && value <= 1);
}

TEST(Tiles, NoiseOfNeighboursIsIndependent) {
  // What 16 samples miss of a blurred edge, in pixels side by side.
  const Tracer tracer("");
  const EyeModel eye = make_eye("navarro", {0, {}, 4.0});
  const auto scene = make_scene("letters:logmar=1,distance_mm=400");
  TraceSettings settings = settings_of(64, 64, 16);
  settings.wavelength_nm = 589.3;
  settings.representation = Representation::smooth;
  const auto few = tracer.trace(eye, *scene, settings).image;
  settings.samples = 2048;
  settings.seed = 2;
  const auto many = tracer.trace(eye, *scene, settings).image;
  const auto noise = [&](int column, int row) {
    return double(few.at(column, row, 1)) - many.at(column, row, 1);
  };
  double product = 0, square = 0;
  for (int row = 0; row < 63; ++row)
    for (int column = 0; column < 63; ++column) {
      square += noise(column, row) * noise(column, row);
      product += noise(column, row) * (noise(column + 1, row) + noise(column, row + 1)) / 2;
    }
  EXPECT_GT(square, 0);
  // 63 x 63 pairs, of which about a third have light and dark in them: 4 standard deviations of chance are
  // 0.11
  EXPECT_LT(std::abs(product / square), 0.12);
}

}  // namespace
}  // namespace emmetrope::raytrace
