#include "raytrace/scene/panorama.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/scene/scene_json.hpp"
#include "raytrace/tracer/tracer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector3d;

/// What a ray in a direction meets of planes at infinity, at the nearest texel.
float seen(const std::vector<TexturedPlane>& planes, const Vector3d& direction) {
  for (const TexturedPlane& plane : planes) {
    const Vector3d at = direction / direction.dot(plane.centre_mm);
    const double across = at.dot(plane.right_mm), above = at.dot(plane.up_mm);
    if (!(direction.dot(plane.centre_mm) > 0) || std::max(std::abs(across), std::abs(above)) > 1) continue;
    const Texture& texture = *plane.texture;
    const auto texel = [&](double share, int count) {
      return std::min(count - 1, static_cast<int>(share * count));
    };
    const int column = texel((1 + across) / 2, texture.width), row = texel((1 - above) / 2, texture.height);
    return texture.values[(static_cast<std::size_t>(row) * texture.width + column) * texture.channels];
  }
  ADD_FAILURE() << "a gap at " << direction.transpose();
  return 0;
}

TEST(Surround, ShowsEveryDirectionItsLight) {
  const Vector3d gradient(0.2, -0.3, 0.25);
  const auto planes = surround(256, 1, [&](const Vector3d& direction, float* light) {
    *light = static_cast<float>(0.5 + direction.dot(gradient));
  });
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 1000; ++i) {
    const Vector3d direction = Vector3d(normal(random), normal(random), normal(random)).normalized();
    EXPECT_NEAR(seen(planes, direction), 0.5 + direction.dot(gradient), 0.004);  // half a texel
  }
}

TEST(Panorama, StraightAheadIsThePicturesMiddleAndItsRightThePatientsRight) {
  Texture picture{64, 32, 1, std::vector<float>(std::size_t{64} * 32)};
  for (int row = 0; row < 32; ++row)
    for (int column = 0; column < 64; ++column)
      picture.values[row * 64 + column] = static_cast<float>(column + 100 * row);
  const auto planes = panorama(picture);
  const auto at = [&](double right_deg, double up_deg) {
    const double right = right_deg * degree, up = up_deg * degree;
    return seen(planes, {-std::sin(right) * std::cos(up), std::sin(up), std::cos(right) * std::cos(up)});
  };
  const auto expected = [](double right_deg, double up_deg) {
    return (0.5 + right_deg / 360) * 64 - 0.5 + 100 * ((0.5 - up_deg / 180) * 32 - 0.5);
  };
  const double texel =
      90.0 / 16 * 64 / 360 + 100 * 90.0 / 16 * 32 / 180;  // of a face, in the picture's values
  for (const double right_deg : {-170.0, -50.0, 0.5, 60.0, 140.0})
    for (const double up_deg : {-60.0, -20.0, 1.0, 45.0, 70.0})
      EXPECT_NEAR(at(right_deg, up_deg), expected(right_deg, up_deg), texel) << right_deg << ' ' << up_deg;
}

// Straight ahead a panorama's face is as far as a chart at infinity.
TEST(Panorama, LiesBehindEverythingElse) {
  const test::TemporaryFolder folder;
  write_png(folder.path() / "black.png", {16, 8, 3, std::vector<float>(std::size_t{16} * 8 * 3, 0)});
  write_png(folder.path() / "white.png", {4, 4, 3, std::vector<float>(std::size_t{4} * 4 * 3, 1)});
  write_file(folder.path() / "scene.json", R"({"objects": [
    {"type": "panorama", "picture": "black.png"},
    {"type": "plane", "centre_mm": [0, 0, 1], "right_mm": [-0.1, 0, 0], "up_mm": [0, 0.1, 0], "at_infinity": true,
     "picture": "white.png"}]})");
  TraceSettings settings;
  settings.grid.width = settings.grid.height = 2;
  settings.grid.field_x_mm = settings.grid.field_y_mm = 0.1;
  settings.samples = 16;
  const TraceResult result =
      Tracer("").trace(make_eye("navarro"), read_scene(folder.path() / "scene.json"), settings);
  for (const float light : result.image.values) EXPECT_NEAR(light, 1, 1e-3);
}

TEST(Panorama, AChartAtInfinityFacesTheEye) {
  const test::TemporaryFolder folder;
  write_file(folder.path() / "scene.json", R"({"objects": [
    {"type": "plane", "centre_mm": [0, 0, -1], "right_mm": [-0.1, 0, 0], "up_mm": [0, 0.1, 0], "at_infinity": true,
     "chart": "dial"}]})");
  try {
    read_scene(folder.path() / "scene.json");
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("centre_mm"));
  }
}

}  // namespace
}  // namespace emmetrope::raytrace
