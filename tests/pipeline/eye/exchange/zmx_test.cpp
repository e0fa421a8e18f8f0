#include "pipeline/eye/exchange/zmx.hpp"

#include <gmock/gmock.h>

#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/exchange/eye_file.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "tests/support/random_eye.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope {
namespace {

using test::TemporaryFolder;

using Eigen::Vector3d;

/// The largest distance between the ends of the same rays in two eyes, mm; rays that end in one only are infinitely
/// apart.
double rays_apart_mm(const EyeModel& one, const EyeModel& other, double wavelength_nm, double slope,
                     int* reached) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-2, 2), tilt(-slope, slope);
  double apart = 0;
  for (int k = 0; k < 200; ++k) {
    const Vector3d direction = Vector3d(tilt(random), tilt(random), -1).normalized();
    const Ray ray{Vector3d(place(random), place(random), -3) - 30 * direction, direction};
    const RayPath a = trace_exact(one, ray, wavelength_nm), b = trace_exact(other, ray, wavelength_nm);
    if (a.state != b.state) return INFINITY;
    if (a.state != RayState::reached) continue;
    ++*reached;
    apart = std::max(apart, (a.hits.back().position_mm - b.hits.back().position_mm).norm());
  }
  return apart;
}

EyeModel there_and_back(const EyeModel& eye, const TemporaryFolder& folder,
                        std::vector<std::string>* notes = nullptr) {
  const std::filesystem::path file = folder.path() / "eye.zmx";
  const std::vector<std::string> said = write_zmx(file, eye);
  if (notes != nullptr) *notes = said;
  return read_zmx(file);
}

// Navarro's eye typed from the literature's table as Zemax saves it, in a foreign program's words.
const char* const navarro_zmx = R"(VERS 100000 123 0
MODE SEQ
NAME Navarro 1985
UNIT MM X W X CM MR CPMM
ENPD 3.0 0
GCAT EYES
WAVM 1 0.58929999999999993 1
PWAV 1
SURF 0
  TYPE STANDARD
  CURV 0.0 0 0 0 0 ""
  DISZ INFINITY
SURF 1
  COMM cornea front
  TYPE STANDARD
  CURV 1.2953367875647668E-001 0 0 0 0 ""
  CONI -2.6E-01
  DISZ 0.55
  GLAS ___BLANK 1 0 1.376 0 0 0 0 0 0 0
SURF 2
  COMM cornea back
  CURV 1.5384615384615385E-001 0 0 0 0 ""
  DISZ 3.05
  GLAS ___BLANK 1 0 1.3374 0 0 0 0 0 0 0
SURF 3
  STOP
  COMM lens front
  CURV 9.8039215686274508E-002
  CONI -3.1316
  DISZ 4
  GLAS ___BLANK 1 0 1.42 0
SURF 4
  COMM lens back
  CURV -1.6666666666666666E-001
  CONI -1
  DISZ 10
  GLAS ___BLANK 1 0 1.336 0
SURF 5
  COMM half way
  DISZ 6.40398
  GLAS ___BLANK 1 0 1.336 0
SURF 6
  CURV -8.333333333333333E-002
)";

TEST(Zmx, ATypedLensIsNavarrosEye) {
  const TemporaryFolder folder;
  write_file(folder.path() / "navarro.zmx", navarro_zmx);
  const EyeModel typed = make_eye((folder.path() / "navarro.zmx").string());
  EXPECT_EQ(typed.name, "Navarro 1985");
  EXPECT_NEAR(entrance_pupil(typed, 589.3).diameter_mm, 3, 1e-9);
  EXPECT_NEAR(typed.surface("lens_posterior").position_mm, 7.6, 1e-12);
  EXPECT_NEAR(typed.axial_length_mm(), 24.00398, 1e-12);
  int reached = 0;
  const EyeModel known = make_eye("navarro", {0, {}, typed.stop()->stop_diameter_mm, Laterality::od});
  EXPECT_LT(rays_apart_mm(typed, known, 589.3, 0.3, &reached), 1e-9);
  EXPECT_GT(reached, 30);
}

TEST(Zmx, SchematicEyesComeBackAsTheyWere) {
  int reached = 0;
  for (const char* name :
       {"navarro", "le-grand", "bennett-rabbetts", "arizona", "atchison:-4", "liou-brennan"}) {
    const TemporaryFolder folder;
    const EyeModel eye = make_eye(name);
    const EyeModel again = there_and_back(eye, folder);
    EXPECT_LT(rays_apart_mm(eye, again, eye.reference_wavelength_nm, 0.4, &reached), 1e-9) << name;
    ASSERT_NE(again.stop(), nullptr);
    EXPECT_EQ(again.stop()->stop_diameter_mm, eye.stop()->stop_diameter_mm) << name;
    for (std::size_t k = 0; k < eye.surfaces.size(); ++k)
      EXPECT_EQ(again.surfaces[k].name, eye.surfaces[k].name);
  }
  EXPECT_GT(reached, 200);
}

TEST(Zmx, AGradientThatZemaxCannotHoldIsRefused) {
  const TemporaryFolder folder;
  EyeModel eye = make_eye("liou-brennan");
  eye.media.at(eye.surface("lens_anterior").medium_after).gradient->terms.push_back({1, 2, 1e-5});
  EXPECT_THROW(there_and_back(eye, folder), Error);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "eye.zmx"));
}

TEST(Zmx, MediaWhoseNamesFallTogetherStayApart) {
  const TemporaryFolder folder;
  EyeModel eye = make_eye("navarro");
  eye.media["medium a"] = eye.media.at("aqueous");
  eye.media["medium-a"] = eye.media.at("vitreous");
  eye.surface("cornea_posterior").medium_after = "medium a";
  eye.surface("lens_posterior").medium_after = "medium-a";
  const EyeModel again = there_and_back(eye, folder);
  int reached = 0;
  EXPECT_LT(rays_apart_mm(eye, again, eye.reference_wavelength_nm, 0.2, &reached), 1e-9);
  EXPECT_GT(reached, 50);
}

TEST(Zmx, DispersionIsKeptWithinWhatTheNotesSay) {
  const TemporaryFolder folder;
  const EyeModel eye = make_eye("navarro");
  std::vector<std::string> notes;
  const EyeModel again = there_and_back(eye, folder, &notes);
  EXPECT_THAT(notes, testing::Not(testing::IsEmpty()));
  for (const char* medium : {"cornea", "aqueous", "lens", "vitreous"})
    for (const double nm : {400., 486.1, 555., 656.3, 780., 900.})
      EXPECT_NEAR(again.medium(medium).index_at(nm, again.reference_wavelength_nm),
                  eye.medium(medium).index_at(nm, eye.reference_wavelength_nm), 2e-5)
          << medium << nm;
}

/// At its reference wavelength such an eye comes back exactly.
TEST(Zmx, AnEyeThatIsAnotherInOtherLightIsWarnedOf) {
  const TemporaryFolder folder;
  EXPECT_THAT(write_eye_file(folder.path() / "lb.zmx", make_eye("liou-brennan")).warning,
              testing::HasSubstr("at 486.13 nm"));
  EXPECT_EQ(write_eye_file(folder.path() / "navarro.zmx", make_eye("navarro")).warning, "");
}

TEST(Zmx, MeasuredEyesComeBackWithTiltsAndToricCorneas) {
  int reached = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const TemporaryFolder folder;
    EyeModel eye = analytic_eye(random_eye(seed));
    // Every turn there is: a stop beside the axis, toric and tilted surfaces, a clear aperture.
    eye.surface("iris").decentre_mm = {0.3, -0.2};
    eye.surface("cornea_anterior").tilt_deg = {3, -5};
    eye.surface("cornea_anterior").semi_diameter_mm = 5.5;
    std::vector<std::string> notes;
    const EyeModel again = there_and_back(eye, folder, &notes);
    EXPECT_LT(rays_apart_mm(eye, again, eye.reference_wavelength_nm, 0.3, &reached), 1e-9) << seed;
    EXPECT_NEAR(again.surface("cornea_anterior").tilt_deg.x(), 3, 1e-9);
    EXPECT_EQ(again.surface("cornea_anterior").semi_diameter_mm, 5.5);
  }
  EXPECT_GT(reached, 400);
}

TEST(Zmx, ZernikeSurfacesComeBackMirroredTwice) {
  const TemporaryFolder folder;
  EyeModel eye = make_eye("navarro");
  std::vector<double> terms(28, 0);
  for (std::size_t j = 3; j < terms.size(); ++j) terms[j] = 0.5 * std::sin(3.0 * static_cast<double>(j));
  eye.surface("cornea_anterior").shape = make_zernike(7.72, 7.72, -0.26, -0.26, 25, 4, terms);
  const EyeModel again = there_and_back(eye, folder);
  int reached = 0;
  EXPECT_LT(rays_apart_mm(eye, again, eye.reference_wavelength_nm, 0.2, &reached), 1e-9);
  EXPECT_GT(reached, 50);
}

TEST(Zmx, ASurfaceWithoutFormulaIsFittedAndItsErrorSaid) {
  const TemporaryFolder folder;
  EyeModel eye = make_eye("navarro");
  // Zernike terms upon a toric base are no surface of Zemax.
  eye.surface("cornea_anterior").shape =
      make_zernike(7.9, 7.5, -0.2, -0.3, 30, 4, {0, 0, 0, 0, 0, 0, 2, -1, 1});
  eye.surface("cornea_anterior").semi_diameter_mm = 4;
  std::vector<std::string> notes;
  const EyeModel again = there_and_back(eye, folder, &notes);
  EXPECT_THAT(notes,
              testing::Contains(testing::HasSubstr("cornea_anterior: a zernike is no surface of Zemax")));
  const Shape &was = *eye.surface("cornea_anterior").shape, &is = *again.surface("cornea_anterior").shape;
  for (int k = 0; k < 100; ++k) {
    const Eigen::Vector2d at = 0.039 * k * Eigen::Vector2d(std::cos(k), std::sin(k));
    EXPECT_NEAR(is.depth_mm(at.x(), at.y()).value(), was.depth_mm(at.x(), at.y()).value(), 5e-5);
  }
}

// A steep lens without rim, fitted nearly to where a sphere of its radius ends: what is a micrometre there is not to be a
// dioptre on the axis.
TEST(Zmx, AFittedSteepLensKeepsPowerAndRefraction) {
  const TemporaryFolder folder;
  EyeModel eye = make_eye("navarro");
  for (const double q : {-1.2, -0.8, -0.2})
    for (const double radius_mm : {-5.2, -6.0}) {
      eye.surface("lens_posterior").shape =
          make_zernike(radius_mm, radius_mm - 0.1, q, q, 20, 5, {0, 0, 0, 0, 0, 0, 0.5});
      const WrittenEye written = write_eye_file(folder.path() / "steep.zmx", eye);
      EXPECT_THAT(written.notes, testing::Contains(testing::HasSubstr("lens_posterior")));
      EXPECT_EQ(written.warning, "");
      const EyeModel again = read_zmx(folder.path() / "steep.zmx");
      const double nm = eye.reference_wavelength_nm;
      EXPECT_NEAR(cardinal_points(again, nm).power_D, cardinal_points(eye, nm).power_D, 0.02) << radius_mm;
      EXPECT_NEAR(paraxial_refraction(again, nm).M_D, paraxial_refraction(eye, nm).M_D, 0.02) << radius_mm;
    }
}

TEST(Zmx, AnEyeWhosePowerIsLostIsWarnedOfInDioptres) {
  const TemporaryFolder folder;
  EyeModel eye = make_eye("navarro");
  std::vector<double> ripples(113, 0);  // of order 14, beyond the order that is fitted
  ripples.back() = 0.5;
  eye.surface("cornea_anterior").shape = make_zernike(7.8, 7.7, -0.2, -0.2, 0, 4, ripples);
  EXPECT_THAT(
      write_eye_file(folder.path() / "rippled.zmx", eye).warning,
      testing::MatchesRegex(".*rippled.zmx is not quite this eye: its power is .* D and not .* D, its "
                            "refraction M .* D and not .* D .*"));
}

// A lens of one tilted surface: Zemax's manual turns about the new axes in the order x, y, z.
TEST(Zmx, CoordinateBreaksTurnAsTheManualSays) {
  const TemporaryFolder folder;
  write_file(folder.path() / "turned.zmx", R"(MODE SEQ
UNIT MM
FLOA
WAVM 1 0.55 1
PWAV 1
SURF 0
  DISZ INFINITY
SURF 1
  TYPE COORDBRK
  PARM 1 0.4
  PARM 2 -0.3
  PARM 3 10
  PARM 4 20
  DISZ 0
SURF 2
  STOP
  CURV 0.125
  DISZ 0
  DIAM 3 1
  GLAS ___BLANK 1 0 1.336 0
SURF 3
  TYPE COORDBRK
  PARM 1 -0.4
  PARM 2 0.3
  PARM 3 -10
  PARM 4 -20
  PARM 6 1
  DISZ 24
SURF 4
  CURV -0.08
)");
  const EyeModel eye = read_zmx(folder.path() / "turned.zmx");
  const Surface& cornea = eye.surface("cornea_anterior");
  EXPECT_NEAR(cornea.decentre_mm.x(), -0.4, 1e-12);  // Zemax's x is the eye's -x
  EXPECT_NEAR(cornea.decentre_mm.y(), -0.3, 1e-12);
  // Its axis in Zemax's frame: x turned by 10 degrees, then the new y by 20, of (0, 0, 1).
  const double a = 10 * degree, b = 20 * degree;
  const Vector3d axis(std::sin(b), -std::sin(a) * std::cos(b), std::cos(a) * std::cos(b));
  const Vector3d in_eye(-axis.x(), axis.y(), -axis.z());
  EXPECT_LT((cornea.eye_from_surface().linear() * -Vector3d::UnitZ() - in_eye).norm(), 1e-12);
  EXPECT_LT((eye.retina().eye_from_surface().linear() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_NEAR(eye.axial_length_mm(), 24, 1e-12);
  EXPECT_EQ(eye.stop()->stop_diameter_mm, 6);
}

std::string fault_of(const std::string& text) {
  const TemporaryFolder folder;
  write_file(folder.path() / "bad.zmx", text);
  try {
    read_zmx(folder.path() / "bad.zmx");
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

std::string changed(const std::string& from, const std::string& to) {
  std::string text = navarro_zmx;
  return text.replace(text.find(from), from.size(), to);
}

TEST(Zmx, WhatEyesDoNotNeedIsRefusedByName) {
  EXPECT_THAT(fault_of("MODE SEQ\n"), testing::HasSubstr("no lens of Zemax"));
  EXPECT_THAT(fault_of(changed("MODE SEQ", "MODE NSC")), testing::HasSubstr("line 2: mode NSC"));
  EXPECT_THAT(fault_of(changed("UNIT MM", "UNIT IN")), testing::HasSubstr("lengths in IN"));
  EXPECT_THAT(fault_of(changed("TYPE STANDARD\n  CURV 1.29", "TYPE TOROIDAL\n  CURV 1.29")),
              testing::HasSubstr("surface 1: a surface of type TOROIDAL"));
  EXPECT_THAT(fault_of(changed("GLAS ___BLANK 1 0 1.42 0", "GLAS MIRROR 0 0")),
              testing::HasSubstr("a mirror"));
  EXPECT_THAT(fault_of(changed("GLAS ___BLANK 1 0 1.42 0", "GLAS N-BK7 0 0 1.5 60")),
              testing::HasSubstr("the glass N-BK7 is in no catalogue"));
  EXPECT_THAT(fault_of(changed("CONI -1\n", "CONI much\n")),
              testing::HasSubstr("CONI: expected a number, found \"much\""));
  EXPECT_THAT(fault_of(changed("PWAV 1", "PWAV 7")), testing::HasSubstr("no primary wavelength"));
  EXPECT_THAT(fault_of(changed("DISZ 4", "DISZ -4")),
              testing::HasSubstr("lies in front of the surface before it"));
  EXPECT_THAT(fault_of(changed("SURF 1\n", "SURF 1e300\n")), testing::HasSubstr("expected a whole number"));
  EXPECT_THAT(fault_of(changed("CONI -1\n", "CONI inf\n")), testing::HasSubstr("expected a number"));
  EXPECT_THAT(fault_of(changed("DISZ 4", "DISZ nan")), testing::HasSubstr("expected a number"));
  EXPECT_THAT(fault_of(changed("  CONI -1\n", "  CONI -1\n  SQAP 1 1\n")),
              testing::HasSubstr("an aperture of type SQAP"));
}

TEST(Zmx, AnotherProgramsCatalogueIsNotOverwritten) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "mine.zmx", catalogue = folder.path() / "mine.agf";
  write_file(catalogue, "CC glasses of the lab\n");
  try {
    write_eye_file(file, make_eye("navarro"));
    ADD_FAILURE() << "written";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::not_writable);
    EXPECT_THAT(error.what(), testing::HasSubstr("mine.agf"));
  }
  EXPECT_EQ(read_file(catalogue), "CC glasses of the lab\n");
  EXPECT_FALSE(std::filesystem::exists(file));
  std::filesystem::remove(catalogue);
  for (const char* name : {"navarro", "arizona"})  // its own is written anew
    EXPECT_THAT(write_eye_file(file, make_eye(name)).files, testing::ElementsAre(file, catalogue));
}

}  // namespace
}  // namespace emmetrope
