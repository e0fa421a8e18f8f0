// True values against closed forms and against the object that is rendered.
#include <gtest/gtest.h>

#include <cmath>

#include "data_samples/phantom/phantom.hpp"
#include "data_samples/phantom/true_optics.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

PlacedEye placed(const EyeGeometry& eye) {
  PlacedEye result;
  result.geometry = eye;
  return result;
}

TEST(PhantomTruth, KeratometryOfASphereIsItsRadius) {
  EyeGeometry eye;
  eye.cornea_radius_x_mm = eye.cornea_radius_y_mm = 7.7;
  eye.cornea_q_x = eye.cornea_q_y = 0;
  const Json truth = eye_truth(placed(eye), 1.42);
  EXPECT_NEAR(truth["keratometry"]["flat"]["power_D"], 337.5 / 7.7, 1e-12);
  EXPECT_NEAR(truth["keratometry"]["cylinder_D"], 0, 1e-12);
  EXPECT_NEAR(truth["keratometry"]["asphericity_q"], 0, 1e-12);
  // 2 sqrt(2 R d - d^2) at d = 2.3 mm.
  EXPECT_NEAR(truth["astigmatism"]["section_2p3mm"]["vertical_mm"], 10.97816, 1e-5);
}

TEST(PhantomTruth, KeratometryOfABiconicIsThatOfItsMeridians) {
  EyeGeometry eye;
  eye.cornea_radius_x_mm = 8.0;
  eye.cornea_radius_y_mm = 7.6;
  eye.cornea_q_x = -0.3;
  eye.cornea_q_y = -0.1;
  eye.cornea_axis_deg = 20;
  const Json truth = eye_truth(placed(eye), 1.42);
  EXPECT_NEAR(truth["keratometry"]["flat"]["radius_mm"], std::sqrt(64 + 0.3 * 2.25), 1e-12);
  EXPECT_NEAR(truth["keratometry"]["flat"]["axis_deg"], 20, 1e-12);
  EXPECT_NEAR(truth["keratometry"]["steep"]["radius_mm"], std::sqrt(7.6 * 7.6 + 0.1 * 2.25), 1e-12);
  EXPECT_NEAR(truth["keratometry"]["steep"]["axis_deg"], 110, 1e-12);
  EXPECT_EQ(truth["astigmatism"]["type"], "with-the-rule");
  const double half = 0.5 * truth["keratometry"]["cylinder_D"].get<double>();
  EXPECT_NEAR(truth["astigmatism"]["J0_D"], half * std::cos(40 * degree), 1e-12);
  EXPECT_NEAR(truth["astigmatism"]["J45_D"], half * std::sin(40 * degree), 1e-12);
}

/// A cone at the apex of a sphere: both slopes add on the keratometer's ring.
TEST(PhantomTruth, KeratometryOfAConeOnASphere) {
  EyeGeometry eye;
  eye.cornea_radius_x_mm = eye.cornea_radius_y_mm = 7.7;
  eye.cornea_q_x = eye.cornea_q_y = 0;
  eye.cone_height_um = 60;
  eye.cone_width_mm = 1.6;
  eye.cone_x_mm = eye.cone_y_mm = 0;
  const double r = 1.5;
  const double slope = r / std::sqrt(7.7 * 7.7 - r * r) + 0.060 * r / 2.56 * std::exp(-r * r / (2 * 2.56));
  const Json truth = eye_truth(placed(eye), 1.42);
  EXPECT_NEAR(truth["astigmatism"]["M_D"], 337.5 * slope / (r * std::sqrt(1 + slope * slope)), 1e-8);
  EXPECT_NEAR(truth["keratometry"]["cylinder_D"], 0, 1e-8);
}

/// The true optics have the cone that is rendered, to a fifth of a micrometre.
TEST(PhantomTruth, OpticsHaveTheCone) {
  const HeadGeometry head = random_keratoconus(5);
  for (const Laterality laterality : both_eyes) {
    const PlacedEye eye = place(head, laterality);
    const EyeGeometry& g = eye.geometry;
    const EyeModel optics = true_optics(eye, head.lens_index);
    EyeGeometry regular = g;
    regular.cone_height_um = 0;
    for (const double x : {-3.5, -1.0, 0.0, 0.8, 3.0})
      for (const double y : {-3.4, -1.1, 0.0, 2.0}) {
        EXPECT_NEAR(*optics.surfaces[0].shape->depth_mm(x, y), anterior_cornea_depth_mm(g, x, y), 2e-4);
        EXPECT_NEAR(anterior_cornea_depth_mm(g, x, y) - anterior_cornea_depth_mm(regular, x, y),
                    cone_depth_mm(g, x, y), 1e-12);
      }
    EXPECT_NEAR(anterior_cornea_depth_mm(g, 0, 0), 0, 1e-12);
    EXPECT_GT(eye_truth(eye, head.lens_index)["astigmatism"]["irregularity_um"], 0.5);
  }
}

TEST(PhantomTruth, TypeOfAstigmatismFollowsTheSteepMeridian) {
  EyeGeometry eye;
  eye.cornea_radius_x_mm = 8.0;
  eye.cornea_radius_y_mm = 7.6;
  for (const auto& [axis, type] : {std::pair(85.0, "against-the-rule"), std::pair(45.0, "oblique"),
                                   std::pair(175.0, "with-the-rule"), std::pair(121.0, "oblique")}) {
    eye.cornea_axis_deg = axis;
    EXPECT_EQ(eye_truth(placed(eye), 1.42)["astigmatism"]["type"], type) << axis;
  }
}

TEST(PhantomTruth, ZernikeTermsOfAParaboloidAreItsDefocusAndPiston) {
  EyeGeometry eye;
  eye.cornea_radius_x_mm = eye.cornea_radius_y_mm = 8;
  eye.cornea_q_x = eye.cornea_q_y = -1;
  const Json truth = eye_truth(placed(eye), 1.42);
  const auto& c = truth["cornea_zernike_um"];
  // -r^2 / 16 mm over 3 mm: piston -281.25 um, defocus -281.25 / sqrt(3) um.
  EXPECT_NEAR(c[0], -281.25, 1e-6);
  EXPECT_NEAR(c[4], -281.25 / std::sqrt(3), 0.01);
  for (const int j : {1, 2, 3, 5, 6, 7, 8, 9}) EXPECT_NEAR(c[j], 0, 1e-9) << j;
}

TEST(PhantomTruth, BulgeAddsItsHeightInScaledSpaceToTheAxialLength) {
  EyeGeometry eye;
  const double without = pole_depth_mm(eye);
  EXPECT_DOUBLE_EQ(without, eye.axial_length_mm);
  eye.bulge_height_mm = 0.6;
  EXPECT_NEAR(pole_depth_mm(eye) - without, 0.6 * eye.globe_semi_z_mm / 11, 1e-12);
  EXPECT_NEAR(eye_truth(placed(eye), 1.42)["optical_axial_length_mm"], pole_depth_mm(eye) + 0.20, 1e-12);
}

// Thin-lens formulas by hand, meridian by meridian, for centred surfaces.
double paraxial_refraction_D(const EyeGeometry& eye, double radius_mm, double lens_index) {
  double v = 1336 / (pole_depth_mm(eye) + 0.20 - eye.anterior_chamber_depth_mm - eye.lens_thickness_mm);
  const auto back_through = [&v](double power_D, double length_mm, double index) {
    v -= power_D;
    v /= 1 + length_mm / 1000 / index * v;
  };
  back_through(1000 * (lens_index - 1.336) / eye.lens_posterior_radius_mm, eye.lens_thickness_mm, lens_index);
  back_through(1000 * (lens_index - 1.336) / eye.lens_anterior_radius_mm,
               eye.anterior_chamber_depth_mm - eye.cornea_thickness_mm, 1.336);
  back_through(-40 / (eye.cornea_back_ratio * radius_mm), eye.cornea_thickness_mm, 1.376);
  return v - 376 / radius_mm;
}

TEST(PhantomTruth, RefractionIsThatOfVergencesByHand) {
  EyeGeometry eye;
  eye.cornea_radius_x_mm = 8.0;
  eye.cornea_radius_y_mm = 7.6;
  eye.cornea_axis_deg = 30;
  const Json refraction = eye_truth(placed(eye), 1.42)["refraction"];
  const double flat = paraxial_refraction_D(eye, 8.0, 1.42);
  const double steep = paraxial_refraction_D(eye, 7.6, 1.42);
  EXPECT_NEAR(refraction["M_D"], (flat + steep) / 2, 1e-9);
  // The steep meridian is the more myopic; a minus cylinder has its axis along the flat one.
  EXPECT_NEAR(refraction["J0_D"], (flat - steep) / 2 * std::cos(60 * degree), 1e-9);
  EXPECT_NEAR(refraction["J45_D"], (flat - steep) / 2 * std::sin(60 * degree), 1e-9);
}

TEST(PhantomTruth, HeadRollTurnsTheAxesAgainstTheScanner) {
  HeadGeometry head = sample_head();
  head.od.gaze_horizontal_deg = head.od.gaze_vertical_deg = 0;
  const double upright = truth(head)["eyes"]["od"]["keratometry"]["flat"]["axis_deg"];
  head.roll_deg = 6;  // left eye higher: for the examiner the head turns counter-clockwise
  const Json rolled = truth(head);
  EXPECT_NEAR(rolled["eyes"]["od"]["keratometry"]["flat"]["axis_deg"].get<double>() - upright, 6, 1e-9);
  const auto& od = rolled["eyes"]["od"]["globe_centre_lps_mm"];
  const auto& os = rolled["eyes"]["os"]["globe_centre_lps_mm"];
  const double rise = os[2].get<double>() - od[2].get<double>();
  const double run = os[0].get<double>() - od[0].get<double>();
  EXPECT_NEAR(std::atan2(rise, run) / degree, 6, 1e-9);
  EXPECT_NEAR(std::hypot(rise, run), head.interpupillary_distance_mm, 1e-9);
}

TEST(PhantomTruth, FrameHasNoSuperiorXAndLooksWhereTheEyeLooks) {
  HeadGeometry head = random_head(3);
  for (const Laterality laterality : both_eyes) {
    const Eigen::Matrix3d frame = place(head, laterality).lps_from_eye.linear();
    EXPECT_NEAR(frame(2, 0), 0, 1e-12);
    EXPECT_GT(frame(0, 0), 0.7);   // +x: the patient's left
    EXPECT_LT(frame(1, 2), -0.7);  // +z: forward
    EXPECT_GT(frame(2, 1), 0.7);   // +y: up
  }
  EXPECT_LT(place(head, Laterality::od).globe_centre_lps().x(),
            place(head, Laterality::os).globe_centre_lps().x());
}

TEST(PhantomTruth, SampleIsAsItsReadmeSays) {
  const Json json = truth(sample_head());
  const Json& od = json["eyes"]["od"];
  EXPECT_GT(od["keratometry"]["cylinder_D"], 2.0);
  EXPECT_LT(od["keratometry"]["cylinder_D"], 2.5);
  EXPECT_EQ(od["astigmatism"]["type"], "with-the-rule");
  EXPECT_NEAR(json["eyes"]["os"]["refraction"]["M_D"], 0, 0.25);
  EXPECT_LT(json["eyes"]["os"]["keratometry"]["cylinder_D"], 0.5);
}

}  // namespace
}  // namespace emmetrope::phantom
