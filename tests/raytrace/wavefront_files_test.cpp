#include "raytrace/wavefront_files.hpp"

#include <gmock/gmock.h>

#include "pipeline/eye/schematic/schematic_eyes.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(WavefrontFiles, APupilThatSurfacesNarrowIsToldOf) {
  const auto told = [](const EyeModel& eye, const Eigen::Vector2d& fovea_mm) {
    WavefrontSettings settings;
    settings.fovea_mm = fovea_mm;
    return narrowed_pupil(eye, measure_wavefront(eye, settings));
  };
  for (const char* name : {"navarro", "gullstrand", "liou-brennan", "atchison:-4"})
    for (const double pupil_mm : {0.5, 4.0, 8.0}) {
      EyeModel eye = make_eye(name);
      eye.set_stop_diameter(pupil_mm);
      EXPECT_EQ(told(eye, {0, 0}), "") << name << pupil_mm;
    }
  EyeModel eye = make_eye("navarro");
  EXPECT_EQ(told(eye, {6, 0}), "");
  eye.set_stop_diameter(8);
  eye.surface("lens_anterior").semi_diameter_mm = 3;
  EXPECT_THAT(told(eye, {0, 0}), testing::HasSubstr("an iris of 8 mm"));
}

}  // namespace
}  // namespace emmetrope::raytrace
