// What the command writes and refuses.
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/json.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/command.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::raytrace {
namespace {

void run(const std::string& line, LateralityChoice laterality = LateralityChoice::both) {
  const Command command = raytrace::command();
  CLI::App app;
  command.declare(app);
  app.parse(line);
  CommonOptions common;
  common.laterality = laterality;
  common.verbosity.quiet = true;
  command.run(common);
}

TEST(TraceCommand, WritesTheSystemThatWasTraced) {
  const test::TemporaryFolder folder;
  const std::string output = (folder.path() / "worn").string();
  run("--eye navarro --spectacle=-2/0x0@12 --pupil 1 --size 8x8 --samples 32 -o " + output);
  // Light that is parallel behind a lens of -2 D, 4 mm of index 1.5 and 12 mm in front of the cornea, has
  // this vergence at the lens's plane front and at the cornea.
  const double at_front_D = 2 / (1 + 2 * 0.004 / 1.5), at_cornea_D = at_front_D / (1 - 0.016 * at_front_D);
  const EyeModel worn = make_eye(output + "/eye.json");
  const double own_D = paraxial_refraction(make_eye("navarro"), worn.reference_wavelength_nm).M_D;
  const double found_D = paraxial_refraction(worn, worn.reference_wavelength_nm).M_D;
  EXPECT_NEAR(found_D - own_D, at_cornea_D, 1e-3);
  const Json wavefront = read_json(output + "/wavefront.json");
  const double radius_mm = wavefront["pupil_mm"].get<double>() / 2;
  const double in_pupil_D =
      -4 * std::sqrt(3.0) * wavefront["zernike_um"][4].get<double>() / (radius_mm * radius_mm);
  const double depth_m = wavefront["pupil_position_mm"].get<double>() / 1000;
  EXPECT_NEAR(in_pupil_D, found_D / (1 + depth_m * found_D), 0.05);  // spherical aberration of a 1 mm pupil
  EXPECT_TRUE(std::filesystem::exists(output + "/psf.tiff"));
}

std::string refusal(const std::string& line) {
  try {
    run(line);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(TraceCommand, OfACaseSaysOneThingOnce) {
  const test::TemporaryFolder folder;
  const std::string traced = folder.path().string();
  EXPECT_NE(refusal(traced + " --fovea=1.5,0").find("nasal in a right eye"), std::string::npos);
  EXPECT_NE(refusal(traced + " --lens-model core --lens-index 1.42").find("Gullstrand's"), std::string::npos);
}

// Navarro's retina is a sphere of 12 mm.
TEST(TraceCommand, GoesToTheRetinasEquatorAndSaysWhereItEnds) {
  const test::TemporaryFolder folder;
  const std::string small = " --size 8x8 --samples 32 --field-mm .05x.05 -o ";
  EXPECT_EQ(refusal("--eye navarro --fovea=11.2,0" + small + (folder.path() / "far").string()), "");
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "far" / "wavefront.json"));
  for (const char* output : {"beyond", "beyond.png"})
    EXPECT_NE(refusal("--eye navarro --fovea=12.2,0" + small + (folder.path() / output).string())
                  .find("the retina does not reach"),
              std::string::npos);
  EyeModel eye = make_eye("navarro");
  eye.surface("retina").semi_diameter_mm = 5;
  const std::string narrow = (folder.path() / "narrow.json").string();
  write_eye(narrow, eye);
  EXPECT_EQ(refusal("--eye " + narrow + " --fovea=4,0" + small + (folder.path() / "in").string()), "");
  EXPECT_NE(refusal("--eye " + narrow + " --fovea=6,0" + small + (folder.path() / "out").string())
                .find("the retina does not reach"),
            std::string::npos);
}

TEST(TraceCommand, AFolderIsOneWhateverItsName) {
  const test::TemporaryFolder folder;
  const std::string small = "--eye navarro --size 8x8 --samples 32 -o ", one = "/iris-0.5mm",
                    two = "/pair.png";
  for (const std::string& name : {one, two}) std::filesystem::create_directory(folder.path().string() + name);
  run(small + folder.path().string() + one);
  run(small + folder.path().string() + two + " --pupillary-distance 62");
  EXPECT_TRUE(std::filesystem::exists(folder.path().string() + one + "/wavefront.json"));
  for (const char* eye : {"/od", "/os"})
    EXPECT_TRUE(std::filesystem::exists(folder.path().string() + two + eye + "/wavefront.json"));
}

TEST(TraceCommand, RefusesAnIrisInAnotherUnit) {
  const test::TemporaryFolder folder;
  for (const char* pupil : {"0.003", "0.3", "15", "30"})
    EXPECT_THROW(run("--eye navarro --size 8x8 --samples 32 --pupil " + std::string(pupil) + " -o " +
                     (folder.path() / "x.png").string()),
                 CLI::ValidationError)
        << pupil;
}

TEST(TraceCommand, RefusesOptionsThatWouldBeIdle) {
  const test::TemporaryFolder folder;
  const std::string output = " -o " + (folder.path() / "x.png").string();
  EXPECT_THROW(run("--eye navarro --age 40" + output), Error);
  EXPECT_THROW(run("--eye navarro --lens-model core" + output), Error);
  EXPECT_THROW(run("--eye navarro --fixate 0,0,300 --strabismus os:5,0" + output, LateralityChoice::od),
               Error);
  EXPECT_THROW(run("--eye navarro --fixate 0,0,300 --strabismus os:" + output, LateralityChoice::os), Error);
  EXPECT_THROW(run("--eye navarro --achromatic --surfaces fast" + output), Error);
  EXPECT_THROW(run("--eye navarro --pupillary-distance 6.2" + output), Error);
  EXPECT_THROW(run("--eye navarro --psf-grid 30:5" + output), Error);
  EXPECT_THROW(run("--eye navarro --disc 4,0" + output), Error);
  EXPECT_THROW(run("--eye navarro --fovea 1,0+-0.3" + output), Error);
  EXPECT_THROW(run("--eye navarro --exposure-steps 0" + output), Error);
  EXPECT_THROW(run("--eye navarro --psf-grid 95:5 -o " + folder.path().string()), Error);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "x.png"));
}

}  // namespace
}  // namespace emmetrope::raytrace
