#include "raytrace/irradiance_files.hpp"

#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <matio.h>
#include <tiffio.h>

#include <cmath>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
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
  light.trolands = {3, 2, 1, {0, 1, 2, 3, 4, 5}};
  light.pupil_area_mm2 = 7;
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
  write_irradiance(numbered(), make_eye("navarro"), trace, {}, {}, folder.path());

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

/// Square pixels of 0.1 mm.
TraceSettings square_pixels() {
  TraceSettings trace;
  trace.grid.width = 3;
  trace.grid.height = 2;
  trace.grid.field_x_mm = 0.3;
  trace.grid.field_y_mm = 0.2;
  return trace;
}

TEST(IrradianceFiles, SayTheirPitchUnitAndWavelength) {
  const test::TemporaryFolder folder;
  write_irradiance(numbered(), make_eye("navarro"), square_pixels(), {}, {{"tiff", "exr"}, true},
                   folder.path());
  const std::unique_ptr<TIFF, decltype(&TIFFClose)> tiff(
      TIFFOpen((folder.path() / "irradiance.tiff").c_str(), "r"), &TIFFClose);
  ASSERT_NE(tiff, nullptr);
  ASSERT_EQ(TIFFSetDirectory(tiff.get(), 1), 1);
  float across = 0;
  std::uint16_t unit = 0;
  const char* text = nullptr;
  TIFFGetField(tiff.get(), TIFFTAG_XRESOLUTION, &across);
  TIFFGetField(tiff.get(), TIFFTAG_RESOLUTIONUNIT, &unit);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEDESCRIPTION, &text);
  EXPECT_NEAR(across, 100, 1e-3);  // pixels a centimetre
  EXPECT_EQ(unit, RESUNIT_CENTIMETER);
  const Json about = Json::parse(text);
  EXPECT_EQ(about["unit"], "photons / (s m^2 nm)");
  EXPECT_EQ(about["wavelength_nm"], 600);
  EXPECT_NEAR(about["um_per_pixel"][1].get<double>(), 100, 1e-9);
  std::vector<float> row(3);
  ASSERT_EQ(TIFFReadScanline(tiff.get(), row.data(), 1), 1);
  // h = 6.62607015e-34 J s, c = 299792458 m/s, of which both are exact.
  EXPECT_NEAR(row[2] / (105 * 600e-9 / (6.62607015e-34 * 299792458)), 1, 1e-6);

  Imf::InputFile exr((folder.path() / "irradiance.exr").c_str());
  EXPECT_EQ(exr.header().typedAttribute<Imf::StringAttribute>("emissiveUnits").value(),
            "photons / (s m^2 nm)");
  EXPECT_NEAR(xDensity(exr.header()), 254, 1e-3);  // pixels an inch
  std::vector<float> pixels(6);
  Imf::FrameBuffer buffer;
  buffer.insert("S0.600,000000nm", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(pixels.data()),
                                              sizeof(float), 3 * sizeof(float)));
  exr.setFrameBuffer(buffer);
  exr.readPixels(0, 1);
  EXPECT_EQ(pixels[5], row[2]);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "irradiance.mat"));
}

/// A field of a structure.
const matvar_t* field(const matvar_t* of, const char* name) {
  return Mat_VarGetStructFieldByName(const_cast<matvar_t*>(of), name, 0);
}
double number(const matvar_t* variable) { return *static_cast<const double*>(variable->data); }

TEST(IrradianceFiles, IsetbioFindsWhatItsGetterAsksFor) {
  const test::TemporaryFolder folder;
  write_irradiance(numbered(), make_eye("navarro"), square_pixels(), {}, {{"isetbio"}, false}, folder.path());
  const std::unique_ptr<mat_t, decltype(&Mat_Close)> mat(
      Mat_Open((folder.path() / "optical-image.mat").c_str(), MAT_ACC_RDONLY), &Mat_Close);
  ASSERT_NE(mat, nullptr);
  const std::unique_ptr<matvar_t, decltype(&Mat_VarFree)> oi(Mat_VarRead(mat.get(), "oi"), &Mat_VarFree);
  ASSERT_NE(oi, nullptr);
  EXPECT_EQ(std::string(static_cast<const char*>(field(oi.get(), "type")->data), 12), "opticalimage");
  const matvar_t* photons = field(field(oi.get(), "data"), "photons");
  ASSERT_EQ(photons->rank, 3);
  EXPECT_NEAR(
      static_cast<const float*>(photons->data)[1 + 2 * 2] / (5 * 500e-9 / (6.62607015e-34 * 299792458)), 1,
      1e-6);
  const matvar_t* wave = field(field(oi.get(), "spectrum"), "wave");
  EXPECT_EQ(static_cast<const double*>(wave->data)[1], 600);
  // oiGet: width = 2 tan(wAngular / 2) x distance, which is the focal length where the scene is far away.
  const double focal_m = number(field(field(oi.get(), "optics"), "focalLength"));
  EXPECT_NEAR(2 * std::tan(number(field(oi.get(), "wAngular")) / 2 * degree) * focal_m, 0.3e-3, 1e-12);
  EXPECT_NEAR(focal_m, 16.5e-3, 0.1e-3);  // Navarro's eye: its retina from its image-side nodal point
  EXPECT_NEAR(number(field(field(oi.get(), "optics"), "fNumber")), focal_m * 1000 / std::sqrt(4 * 7 / pi),
              1e-9);
}

TEST(IrradianceFiles, AreTheSameBytesAgain) {
  const test::TemporaryFolder a, b;
  for (const auto* folder : {&a, &b})
    write_irradiance(numbered(), make_eye("navarro"), square_pixels(), {}, {irradiance_formats, false},
                     folder->path());
  for (const auto& file : std::filesystem::directory_iterator(a.path()))
    EXPECT_EQ(read_file(file.path()), read_file(b.path() / file.path().filename())) << file.path();
}

}  // namespace
}  // namespace emmetrope::raytrace
