#include <gmock/gmock.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/exact_trace.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/schematic/schematic_eyes.hpp"
#include "raytrace/spectacle/spectacle.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::raytrace {
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

/// The same from collimated rays into the eye, against a sphere about the paraxial focus through the exit
/// pupil.
double inward_c40_um(const std::string& name, double parameter, double pupil_mm) {
  EyeOptions options;
  options.accommodation_parameter = parameter;
  options.pupil_mm = 20;
  const EyeModel eye = make_eye(name, options);
  const double nm = eye.reference_wavelength_nm, n = eye.medium("vitreous").index_at(nm, nm);
  const Eigen::Vector3d focus(0, 0, -cardinal_points(eye, nm).image_focal_mm);
  const double radius_mm = -exit_pupil(eye, nm).position_mm - focus.z();
  const auto path_mm = [&](double height_mm) {
    const RayPath path = trace_exact(eye, {{0, height_mm, 10}, {0, 0, -1}}, nm);
    const RayHit& last = path.hits.at(path.hits.size() - 2);
    const Eigen::Vector3d from_focus = last.position_mm - focus;
    const double b = from_focus.dot(last.direction);
    return last.opl_mm + n * (-b - std::sqrt(b * b - from_focus.squaredNorm() + radius_mm * radius_mm));
  };
  double sum = 0;
  constexpr int rings = 400;
  for (int k = 0; k < rings; ++k) {
    const double s = (k + 0.5) / rings;
    sum += std::sqrt(5.0) * (6 * s * s - 6 * s + 1) * (path_mm(pupil_mm / 2 * std::sqrt(s)) - path_mm(0)) /
           rings;
  }
  return 1000 * std::abs(sum);
}

struct Row {
  const char* name;
  double parameter, c40_4mm, c40_6mm;
};
class SphericalTermOf : public testing::TestWithParam<Row> {};
TEST_P(SphericalTermOf, AgreesWithTheTable) {
  // The table's rays go into the eye. The wavefront that leaves it differs in second order of the aberration:
  // by 0.1 % of the largest row and less than the last digit in the others.
  const Row& row = GetParam();
  constexpr double last_digit = 1e-4;
  EXPECT_NEAR(inward_c40_um(row.name, row.parameter, 4), row.c40_4mm, last_digit);
  EXPECT_NEAR(c40_um(row.name, row.parameter, 4), row.c40_4mm, 4e-3 * row.c40_4mm * row.c40_4mm + last_digit);
  if (!std::isnan(row.c40_6mm)) {
    EXPECT_NEAR(inward_c40_um(row.name, row.parameter, 6), row.c40_6mm, last_digit);
    EXPECT_NEAR(c40_um(row.name, row.parameter, 6), row.c40_6mm,
                4e-3 * row.c40_6mm * row.c40_6mm + last_digit);
  }
}
INSTANTIATE_TEST_SUITE_P(
    Tables, SphericalTermOf,
    testing::Values(Row{"gullstrand", 0, 0.1158, 0.6549}, Row{"gullstrand", 10.87, 0.3498, NAN},
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

TEST(Wavefront, TiltedLensHasTheSameCentreByExactRaysNearTheAxis) {
  EyeModel eye = make_eye("navarro");
  for (const char* name : {"lens_anterior", "lens_posterior"}) {
    eye.surface(name).tilt_deg = {0, 8};
    eye.surface(name).decentre_mm = {0.2, 0};
  }
  // The stop where the axis ray passes, so that the line of sight is that ray.
  const RayPath axis = trace_exact(eye, {{0, 0, -24.0039}, {0, 0, 1}}, 589.3);
  const RayHit& behind_stop = axis.hits.at(1);
  ASSERT_EQ(behind_stop.surface, "lens_anterior");
  const Eigen::Vector3d& p = behind_stop.position_mm;
  eye.surface("iris").decentre_mm =
      (p + (-3.6 - p.z()) / behind_stop.direction.z() * behind_stop.direction).head<2>();
  // The lens tilted about y: oblique astigmatism, most power in the plane of the tilt.
  const PowerVector near_axis = paraxial_refraction(eye, 589.3);
  EXPECT_LT(near_axis.J0_D, -0.02);
  EXPECT_NEAR(near_axis.J45_D, 0, 1e-6);
  const Wavefront wavefront = measure_wavefront(eye, entrance(1));
  const PowerVector centre = at_vertex(wavefront, wavefront.paraxial, 0);
  EXPECT_NEAR(centre.M_D, near_axis.M_D, 1e-3);
  EXPECT_NEAR(centre.J0_D, near_axis.J0_D, 1e-3);
}

TEST(Wavefront, ExactRaysNearTheAxisAreTheParaxialOnesOfACentredEye) {
  EyeModel eye = toric_navarro();
  const PowerVector centred = paraxial_refraction(eye, 589.3);
  eye.surface("lens_posterior").tilt_deg = {1e-7, 0};
  const PowerVector traced = paraxial_refraction(eye, 589.3);
  EXPECT_NEAR(traced.M_D, centred.M_D, 1e-5);
  EXPECT_NEAR(traced.J0_D, centred.J0_D, 1e-5);
}

TEST(Wavefront, SpotOfPureDefocusIsItsVergenceTimesThePupil) {
  const Wavefront wavefront = measure_wavefront(make_eye("atchison:-4"), entrance(1));
  // rms radius of a disc of radius M r is M r / sqrt(2)
  const double expected = std::abs(wavefront.paraxial.M_D) * 1e-3 * 0.5 / std::sqrt(2.0) / degree * 60;
  EXPECT_NEAR(wavefront.spot_rms_arcmin(), expected, 0.01 * expected);
}

TEST(Wavefront, NoStopIsAnError) {
  EyeModel eye = make_eye("navarro");
  eye.surfaces.erase(eye.surfaces.begin() + 2);
  EXPECT_THROW(measure_wavefront(eye, {}), Error);
  EXPECT_NO_THROW(measure_wavefront(eye, entrance(3)));
}

TEST(Wavefront, AStopWithoutAnEntrancePupilIsSaid) {
  EyeModel eye = make_eye("navarro");
  eye.surface("cornea_anterior").shape = make_conic(0.772, -0.26);  // one digit lost
  EXPECT_THAT([&] { measure_wavefront(eye, {}); },
              testing::ThrowsMessage<Error>(testing::AllOf(testing::HasSubstr("upside down"),
                                                           testing::Not(testing::HasSubstr("no stop")))));
}

/// Not as a fault of the eye.
TEST(Wavefront, AnEntrancePupilThatIsNoneIsAUsageError) {
  EyeModel without_stop = make_eye("navarro");
  without_stop.surfaces.erase(without_stop.surfaces.begin() + 2);
  for (const EyeModel& eye : {make_eye("navarro"), without_stop})
    for (const double pupil_mm : {-3.0, 0.0, std::nan("")}) {
      try {
        measure_wavefront(eye, entrance(pupil_mm));
        ADD_FAILURE() << pupil_mm << " mm was accepted";
      } catch (const Error& error) {
        EXPECT_EQ(error.status(), ExitStatus::usage) << error.what();
        EXPECT_THAT(error.what(), testing::HasSubstr("the entrance pupil is"));
      }
    }
}

}  // namespace
}  // namespace emmetrope::raytrace
