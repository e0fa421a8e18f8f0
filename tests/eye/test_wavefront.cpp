#include <gmock/gmock.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/eye/paraxial.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope {
namespace {

WavefrontSettings entrance(double pupil_mm, int order = 8) {
  WavefrontSettings settings;
  settings.entrance_pupil_mm = pupil_mm;
  settings.order = order;
  return settings;
}

/// c40 of rays from the paraxial focus: the eye with its retina there.
double c40_um(const std::string& name, double parameter, double pupil_mm) {
  EyeOptions options;
  options.accommodation_parameter = parameter;
  EyeModel eye = make_eye(name, options);
  eye.surfaces.back().position_mm = cardinal_points(eye, eye.reference_wavelength_nm).image_focal_mm;
  return measure_wavefront(eye, entrance(pupil_mm)).zernike_um.at(12);
}

struct Row {
  const char* name;
  double parameter, c40_4mm, c40_6mm;
};
class SphericalTermOf : public testing::TestWithParam<Row> {};
TEST_P(SphericalTermOf, AgreesWithTheTable) {
  // The table's wavefronts are referred to the paraxial focus.
  EXPECT_NEAR(c40_um(GetParam().name, GetParam().parameter, 4), GetParam().c40_4mm, 2e-4);
  if (!std::isnan(GetParam().c40_6mm)) {
    EXPECT_NEAR(c40_um(GetParam().name, GetParam().parameter, 6), GetParam().c40_6mm, 1e-3);
  }
}
INSTANTIATE_TEST_SUITE_P(
    Tables, SphericalTermOf,
    testing::Values(Row{"gullstrand", 0, 0.1158, 0.6549}, Row{"gullstrand", 10.87013, 0.3498, NAN},
                    Row{"le-grand", 0, 0.1162, 0.6563}, Row{"navarro", 0, 0.0421, 0.2406},
                    Row{"escudero-sanz-navarro", 0, 0.0423, 0.2419}, Row{"arizona", 0, 0.0374, 0.2247}));

TEST(Wavefront, GullstrandsLeastVarianceFocusDependsOnThePupil) {
  const EyeModel eye = make_eye("gullstrand");
  EXPECT_NEAR(measure_wavefront(eye, entrance(4)).minimum_rms_wavefront.M_D, -0.75, 0.01);
  EXPECT_NEAR(measure_wavefront(eye, entrance(6)).minimum_rms_wavefront.M_D, -1.81, 0.01);
  const Wavefront small = measure_wavefront(eye, entrance(2));
  // For primary aberration the least rms spot lies at four thirds of the least rms wavefront.
  EXPECT_NEAR(small.minimum_rms_spot.M_D / small.minimum_rms_wavefront.M_D, 4.0 / 3, 0.01);
}

TEST(Wavefront, ParaxialCriterionIsTheParaxialRefraction) {
  for (const char* name : {"gullstrand", "navarro", "arizona", "atchison:-4", "atchison:-10"}) {
    const EyeModel eye = make_eye(name);
    const Wavefront wavefront = measure_wavefront(eye, entrance(3, 4));
    const PowerVector expected = paraxial_refraction(eye, eye.reference_wavelength_nm);
    EXPECT_NEAR(at_vertex(wavefront, wavefront.paraxial, 0).M_D, expected.M_D, 2e-4) << name;
  }
}

// A biconic cornea of 7.6967 mm in y and 7.9487 mm in x: paraxial M -1.403, J0 0.778; by second-order Zernike
// terms over the entrance pupil M -1.395, J0 0.771. Dividing by the exit pupil's radius instead would give M
// -1.708.
EyeModel toric_navarro() {
  EyeModel eye = make_eye("navarro");
  eye.surface("cornea_anterior").shape = make_biconic(7.9487, 7.6967, -0.26, -0.26, 0);
  return eye;
}

TEST(Wavefront, EntrancePupilScalesTheRefractionOfAToricEye) {
  const EyeModel eye = toric_navarro();
  const PowerVector paraxial = paraxial_refraction(eye, eye.reference_wavelength_nm);
  const Wavefront wavefront = measure_wavefront(eye, entrance(2));
  const PowerVector centre = at_vertex(wavefront, wavefront.paraxial, 0);
  EXPECT_NEAR(centre.M_D, paraxial.M_D, 1e-3);
  EXPECT_NEAR(centre.J0_D, paraxial.J0_D, 1e-3);
  EXPECT_NEAR(centre.J45_D, 0, 1e-6);
}

TEST(Wavefront, MyopiaHasAPositiveDefocusTermAndWithTheRuleAPositiveJ0) {
  EXPECT_GT(measure_wavefront(make_eye("atchison:-6"), entrance(3)).zernike_um[4], 0);
  // Steep vertical meridian: with the rule, corrected by minus cylinder at 180, J0 > 0.
  EXPECT_GT(measure_wavefront(toric_navarro(), entrance(3)).minimum_rms_wavefront.J0_D, 0.5);
}

TEST(Wavefront, TurnedAstigmatismTurnsItsPowerVector) {
  for (const double axis_deg : {0.0, 20.0, 45.0, 110.0}) {
    EyeModel eye = make_eye("navarro");
    eye.surface("cornea_anterior").shape = make_biconic(7.9487, 7.6967, -0.26, -0.26, axis_deg);
    const Wavefront wavefront = measure_wavefront(eye, entrance(3));
    const SpheroCylinder rx = to_sphero_cylinder(at_vertex(wavefront, wavefront.minimum_rms_wavefront, 12));
    EXPECT_LT(rx.cylinder_D, -1);
    EXPECT_NEAR(std::sin(2 * (rx.axis_deg - axis_deg) * degree), 0, 1e-6);
    EXPECT_NEAR(std::cos(2 * (rx.axis_deg - axis_deg) * degree), 1, 1e-6);
  }
}

TEST(Wavefront, ASpectacleOfTheFoundPowerLeavesNoDefocus) {
  const EyeModel eye = make_eye("atchison:-6");
  const Wavefront bare = measure_wavefront(eye, entrance(2, 6));
  const PowerVector rx = at_vertex(bare, bare.paraxial, 12);
  const Wavefront corrected = measure_wavefront(with_thin_lens(eye, rx, 12), entrance(2, 6));
  EXPECT_NEAR(corrected.paraxial.M_D, 0, 1e-3);
  EXPECT_NEAR(corrected.paraxial.J0_D, 0, 1e-3);
}

TEST(Wavefront, CriteriaAgreeWhereThereIsNoAberration) {
  // A single refracting surface with Q = -1/n^2 and its retina at the focus images an axial point without
  // aberration.
  EyeModel eye;
  eye.name = "cartesian";
  const double n = 1.336, radius_mm = 5.6;
  eye.media["vitreous"].index = n;
  Surface cornea, iris, retina;
  cornea.name = "cornea_anterior";
  cornea.shape = make_conic(radius_mm, -1 / (n * n));
  cornea.medium_after = "vitreous";
  iris.name = "iris";
  iris.position_mm = 1;
  iris.stop_diameter_mm = 4;
  retina.name = "retina";
  retina.shape = make_sphere(-11);
  retina.position_mm = n / (n - 1) * radius_mm;
  eye.surfaces = {cornea, iris, retina};
  const Wavefront wavefront = measure_wavefront(eye, {});
  EXPECT_LT(wavefront.rms_um(), 1e-6);
  const RefractionCriteria rx = refraction_by_wavefront(wavefront, 12);
  for (const PowerVector& p :
       {rx.paraxial, rx.minimum_rms_wavefront, rx.minimum_rms_spot, rx.visual_strehl}) {
    EXPECT_NEAR(p.M_D, 0, 2e-3);
    EXPECT_NEAR(p.J0_D, 0, 2e-3);
    EXPECT_NEAR(p.J45_D, 0, 2e-3);
  }
}

TEST(Wavefront, NasalStopOfLiouAndBrennanTiltsTheLineOfSightAndBringsComa) {
  const Wavefront wavefront = measure_wavefront(make_eye("liou-brennan"), entrance(4));
  EXPECT_LT(std::abs(wavefront.line_of_sight_deg.x()),
            1);  // the pole is its focus: parallel to the axis but for aberration
  EXPECT_GT(std::abs(wavefront.zernike_um[8]), 0.01);
  EXPECT_NEAR(wavefront.zernike_um[7], 0, 1e-6);
}

TEST(Wavefront, MoreRaysOrTermsChangeNothing) {
  const EyeModel eye = toric_navarro();
  const Wavefront six = measure_wavefront(eye, entrance(5, 6)), ten = measure_wavefront(eye, entrance(5, 10));
  for (int j = 3; j < 15; ++j) EXPECT_NEAR(six.zernike_um[j], ten.zernike_um[j], 1e-6) << j;
  EXPECT_LT(ten.fit_residual_rms_um, 1e-5);
}

TEST(Wavefront, NoStopIsAnError) {
  EyeModel eye = make_eye("navarro");
  eye.surfaces.erase(eye.surfaces.begin() + 2);
  EXPECT_THROW(measure_wavefront(eye, {}), Error);
  EXPECT_NO_THROW(measure_wavefront(eye, entrance(3)));
}

}  // namespace
}  // namespace emmetrope
