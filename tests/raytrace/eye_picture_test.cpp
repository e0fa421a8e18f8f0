#include "raytrace/eye_picture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <sstream>

#include "pipeline/base/frames.hpp"
#include "tests/support/plain_eye.hpp"
#include "tests/support/random_conic_eye.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(PictureJson, ScaleIsTheAngleBetweenChiefRaysOfNeighbouringPixels) {
  for (int seed = 1; seed < 4; ++seed) {
    EyeModel eye = random_conic_eye(seed);
    eye.surface("retina").position_mm += 1.8;  // a myope of about 5 D
    TraceSettings settings;
    settings.grid.width = 100;
    settings.grid.height = 50;
    settings.grid.centre_mm = {2.0 * seed, -1};
    TraceResult result;
    result.wall_s = 1;
    const Json scale = picture_json(result, "", eye, settings)["scale"];
    const PlainEye plain(eye, eye.reference_wavelength_nm);
    const Eigen::Vector2d pixel_mm(6.0 / 100, 6.0 / 50);
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d half = pixel_mm[k] / 2 * Eigen::Vector2d::Unit(k);
      const PlainPupil before(plain, settings.grid.centre_mm - half, 3),
          behind(plain, settings.grid.centre_mm + half, 3);
      const double expected = std::asin(before.sight.cross(behind.sight).norm()) / degree * 60;
      EXPECT_NEAR(scale["arcmin_per_pixel"][k].get<double>(), expected, 1e-5 * expected);
      EXPECT_DOUBLE_EQ(scale["um_per_pixel"][k].get<double>(), 1000 * pixel_mm[k]);
    }
  }
}

/// What is warned of a white picture, of whose rays so many met something.
std::string warned_of_white(std::uint64_t reached) {
  std::ostringstream said;
  const auto before = spdlog::default_logger();
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_st>(said)));
  TraceResult result;
  result.image = {2, 1, 1, {1, 1}};
  result.rays = 64;
  result.states = {{RayState::reached, reached},
                   {RayState::missed_scene, 64 - reached},
                   {RayState::missed_surface, 0},
                   {RayState::tir, 0},
                   {RayState::vignetted, 0}};
  warn_of_doubts(result, {});
  spdlog::set_default_logger(before);
  return said.str();
}

TEST(Doubts, OfABlankPictureTellWhetherRaysMetTheScene) {
  EXPECT_THAT(warned_of_white(0), testing::HasSubstr("no ray meets what the scene holds"));
  const std::string of_a_white_model = warned_of_white(20);
  EXPECT_THAT(of_a_white_model, testing::HasSubstr("what rays meet is everywhere as bright"));
  EXPECT_THAT(of_a_white_model, testing::Not(testing::HasSubstr("outside the field")));
}

}  // namespace
}  // namespace emmetrope::raytrace
