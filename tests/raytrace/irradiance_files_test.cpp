#include "raytrace/irradiance_files.hpp"

#include <gtest/gtest.h>
#include <matio.h>

#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/files.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

/// 3 x 2 pixels, two bands; every value tells its place.
RetinalIrradiance numbered() {
  RetinalIrradiance light;
  light.wavelength_nm = {500, 600};
  light.transmittance = {0.4, 0.6};
  light.white_radiance = {1, 2};
  light.cones = {3, 2, 3, {}};
  for (int i = 0; i < 18; ++i) light.cones.values.push_back(static_cast<float>(i));
  for (int band = 0; band < 2; ++band) {
    LinearImage image{3, 2, 1, {}};
    for (int i = 0; i < 6; ++i) image.values.push_back(static_cast<float>(100 * band + i));
    light.irradiance.push_back(image);
  }
  return light;
}

TEST(IrradianceFiles, HoldWhatWasTraced) {
  const test::TemporaryFolder folder;
  TraceSettings trace;
  trace.grid.width = 3;
  trace.grid.height = 2;
  write_irradiance(numbered(), make_eye("navarro"), trace, {}, folder.path());

  const Json json = read_json(folder.path() / "irradiance.json");
  EXPECT_EQ(json["wavelength_nm"], Json({500.0, 600.0}));
  EXPECT_EQ(json["irradiance"]["unit"], "W / (m^2 nm)");
  EXPECT_EQ(json["media_age_years"], 40);
  EXPECT_NEAR(json["scale"]["um_per_pixel"][0].get<double>(), 2000, 1e-9);

  std::vector<cv::Mat> pages;
  ASSERT_TRUE(cv::imreadmulti((folder.path() / "irradiance.tiff").string(), pages, cv::IMREAD_UNCHANGED));
  ASSERT_EQ(pages.size(), 2U);
  EXPECT_EQ(pages[1].at<float>(1, 2), 105);
  const cv::Mat cones = cv::imread((folder.path() / "cones.tiff").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(cones.at<cv::Vec3f>(0, 1), cv::Vec3f(5, 4, 3));  // OpenCV has the last channel first

  mat_t* mat = Mat_Open((folder.path() / "irradiance.mat").c_str(), MAT_ACC_RDONLY);
  ASSERT_NE(mat, nullptr);
  matvar_t* irradiance = Mat_VarRead(mat, "irradiance");
  ASSERT_NE(irradiance, nullptr);
  ASSERT_EQ(irradiance->rank, 3);
  EXPECT_EQ(irradiance->dims[0], 2U);
  EXPECT_EQ(irradiance->dims[1], 3U);
  EXPECT_EQ(irradiance->dims[2], 2U);
  // Row 1, column 2, band 1, column after column.
  EXPECT_EQ(static_cast<const float*>(irradiance->data)[1 + 2 * (2 + 3 * 1)], 105);
  Mat_VarFree(irradiance);
  Mat_Close(mat);

  remove_irradiance(folder.path());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace emmetrope::raytrace
