#include "raytrace/scene/sampled_spectrum.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "raytrace/picture/spectrum.hpp"
#include "raytrace/scene/scene_json.hpp"
#include "raytrace/scene/scene_model.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

TEST(SampledSpectrum, IsLinearBetweenItsWavelengths) {
  const SampledSpectrum spectrum{{400, 500, 700}, {1, 3, 1}};
  EXPECT_DOUBLE_EQ(spectrum.at(450), 2);
  EXPECT_DOUBLE_EQ(spectrum.at(700), 1);
  EXPECT_DOUBLE_EQ(spectrum.at(400), 1);
  EXPECT_EQ(spectrum.at(399), 0);
  EXPECT_EQ(spectrum.held_at(399), 1);
  EXPECT_EQ(spectrum.held_at(900), 1);
}

TEST(SampledSpectrum, GreySurfacesAreGreyAndRedOnesRed) {
  const Eigen::Vector3d grey = colour_of_reflectance({{500}, {0.3}});
  EXPECT_NEAR((grey - Eigen::Vector3d::Constant(0.3)).norm(), 0, 1e-9);
  const Eigen::Vector3d red = colour_of_reflectance({{580, 620}, {0, 1}});
  EXPECT_GT(red.x(), 3 * red.y());
  EXPECT_GT(red.x(), 3 * red.z());
}

TEST(SampledSpectrum, TheDisplaysWhiteIsWhite) {
  const DisplayPrimaries display;
  SampledSpectrum white;
  double luminance = 0;
  for (double nm = 390; nm <= 700; nm += 1) {
    white.wavelength_nm.push_back(nm);
    white.values.push_back(display.at(nm).sum());
    luminance += white.values.back() * cie_1931(nm).y();
  }
  const Eigen::Vector3d rgb = colour_of_light(white);
  // sRGB's white has the luminance 1 for each channel 1.
  EXPECT_NEAR((rgb / luminance - Eigen::Vector3d::Ones()).norm(), 0, 0.01);
}

TEST(SampledSpectrum, IsReadFromASceneAndRefusedByItsKey) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "scene.json";
  const auto read = [&](const std::string& material, const std::string& light) {
    write_file(file, R"({"objects": [{"type": "plane", "lit": true, "chart": "grid", "centre_mm": [0, 0, 500],
                         "right_mm": [-50, 0, 0], "up_mm": [0, 50, 0])" +
                         material + R"(}], "lights": [{"type": "directional", "direction": [0, 0, 1])" +
                         light + "}]}");
    return read_scene(file);
  };
  const std::string red = R"(, "reflectance": {"wavelengths_nm": [580, 620], "values": [0, 1]})";
  const std::string lamp = R"(, "radiance": {"wavelengths_nm": [400, 700], "values": [0.01, 0.02]})";
  const Scene scene = read(red, lamp);
  EXPECT_DOUBLE_EQ(scene.meshes[0].material.reflectance->held_at(600), 0.5);
  EXPECT_GT(scene.meshes[0].material.colour.x(), 3 * scene.meshes[0].material.colour.y());
  EXPECT_DOUBLE_EQ(scene.lights[0].radiance->at(550), 0.015);
  EXPECT_NEAR(scene.lights[0].colour.maxCoeff(), 1, 1e-12);
  const auto fault = [&](const std::string& material, const std::string& light) -> std::string {
    try {
      read(material, light);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  using testing::HasSubstr;
  EXPECT_THAT(fault(R"(, "colour": [1, 1, 1])" + red, lamp), HasSubstr("reflectance"));
  EXPECT_THAT(fault(R"(, "reflectance": {"wavelengths_nm": [580, 620], "values": [0, 1.1]})", lamp),
              HasSubstr("0 to 1"));
  EXPECT_THAT(fault(R"(, "reflectance": {"wavelengths_nm": [620, 580], "values": [0, 1]})", lamp),
              HasSubstr("rise"));
  EXPECT_THAT(fault(R"(, "reflectance": {"wavelengths_nm": [620], "values": [0, 1]})", lamp),
              HasSubstr("as many"));
  EXPECT_THAT(fault(R"(, "reflectance": 0.5)", lamp), HasSubstr("no object"));
  EXPECT_THAT(fault(red, R"(, "radiance": {"wavelengths_nm": [400]})"), HasSubstr("values"));
}

}  // namespace
}  // namespace emmetrope::raytrace
