#include "pipeline/eye/parametric/corneal_metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "meshing/biometry.hpp"
#include "pipeline/base/astigmatism.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

using namespace meshing;

CornealDepth conic(double radius_mm, double q) {
  return [=](double x, double y) {
    const double r2 = x * x + y * y;
    return r2 / (radius_mm * (1 + std::sqrt(1 - (1 + q) * r2 / (radius_mm * radius_mm))));
  };
}

TEST(CornealMetrics, AxialRadiusOfAConicIsTheClosedForm) {
  for (const double q : {-0.6, -0.2, 0.0, 0.3})
    for (const double r : {0.5, 1.5, 3.0})
      EXPECT_NEAR(axial_radius_mm(conic(7.7, q), r, 0.7), std::sqrt(7.7 * 7.7 - q * r * r), 1e-9);
}

TEST(CornealMetrics, SphereHasItsPowerAndNoAstigmatism) {
  const CornealPower power = corneal_power(conic(7.8, 0));
  EXPECT_NEAR(power.M_D, 337.5 / 7.8, 1e-9);  // 43.27 D
  EXPECT_NEAR(std::hypot(power.J0_D, power.J45_D), 0, 1e-9);
}

TEST(CornealMetrics, ToricConicHasThePowersOfItsMeridians) {
  for (const double flat_deg : {0.0, 12.0, 90.0, 135.0, 178.0}) {
    ParametricEye eye;
    const double flat_R = 8.0, steep_R = 7.6, q = -0.25;
    const double half = (1 / steep_R - 1 / flat_R) / 2;
    eye.cornea_c_per_mm = (1 / steep_R + 1 / flat_R) / 2;
    eye.cornea_j0_per_mm = half * std::cos(2 * (flat_deg + 90) * degree);
    eye.cornea_j45_per_mm = half * std::sin(2 * (flat_deg + 90) * degree);
    eye.cornea_q = q;
    const auto power_D = [&](double r0) { return 337.5 / std::sqrt(r0 * r0 - q * 1.5 * 1.5); };
    const CornealPower power = corneal_power(anterior_cornea(eye));
    const double cylinder = power_D(steep_R) - power_D(flat_R);
    EXPECT_NEAR(power.M_D, (power_D(steep_R) + power_D(flat_R)) / 2, 1e-8);
    EXPECT_NEAR(power.J0_D, cylinder / 2 * std::cos(2 * flat_deg * degree), 1e-5) << flat_deg;
    EXPECT_NEAR(power.J45_D, cylinder / 2 * std::sin(2 * flat_deg * degree), 1e-5) << flat_deg;
  }
}

TEST(CornealMetrics, AsphericityOfAConicIsItsQ) {
  for (const double q : {-0.5, -0.18, 0.0, 0.2}) EXPECT_NEAR(asphericity(conic(7.7, q)), q, 1e-6);
}

TEST(CornealMetrics, SectionOfASphereIsTheClosedForm) {
  const double width = section_width_mm(conic(7.7, 0), 2.3, 0);
  EXPECT_NEAR(width, 2 * std::sqrt(2 * 7.7 * 2.3 - 2.3 * 2.3), 1e-9);
  EXPECT_NEAR(width, 10.98, 0.005);
  EXPECT_NEAR(section_width_mm(conic(7.7, -0.26), 2.3, 1), 11.2, 0.05);
  // Inside the mesh's reach the depth exists, although the hemisphere ends soon after.
  EXPECT_NEAR(section_width_mm(conic(2.31, 0), 2.3, 0), 2 * std::sqrt(2 * 2.31 * 2.3 - 2.3 * 2.3), 1e-3);
  EXPECT_THROW(section_width_mm(conic(50, 0), 2.3, 0), Error);
}

TEST(CornealMetrics, ZernikeProjectionRecoversAPolynomial) {
  Eigen::VectorXd truth = Eigen::VectorXd::Zero(zernike_count(6));
  for (int i = 0; i < truth.size(); ++i) truth[i] = std::sin(3.0 * i + 1);
  const double zone_mm = 6;
  const CornealDepth depth = [&](double x, double y) {
    return -truth.dot(zernike_values(6, 2 * x / zone_mm, 2 * y / zone_mm)) / 1000;
  };
  EXPECT_LT((corneal_zernike_um(depth, zone_mm, 6) - truth).cwiseAbs().maxCoeff(), 1e-10);
}

TEST(CornealMetrics, ZernikeOfASphereHasItsDefocusAndSphericalAberration) {
  // Sag of a sphere to sixth order in r: r^2/2R + r^4/8R^3 + r^6/16R^5; the r^8 term is under 0.1 um here.
  const double R = 7.8, a = 3;
  const Eigen::VectorXd z = corneal_zernike_um(conic(R, 0), 2 * a, 6);
  const double s2 = a * a / (2 * R), s4 = std::pow(a, 4) / (8 * R * R * R),
               s6 = std::pow(a, 6) / (16 * std::pow(R, 5));
  EXPECT_NEAR(
      z[4], -1000 * (s2 / (2 * std::sqrt(3)) + s4 / (2 * std::sqrt(3)) + s6 * 0.9 / (2 * std::sqrt(3))), 0.3);
  EXPECT_NEAR(z[12], -1000 * (s4 / (6 * std::sqrt(5)) + s6 / (4 * std::sqrt(5))), 0.1);
  EXPECT_NEAR(z[3], 0, 1e-9);
  EXPECT_NEAR(z[5], 0, 1e-9);
}

TEST(CornealMetrics, AstigmatismIsNamedBySteepMeridian) {
  EXPECT_EQ(astigmatism_type(90), "with-the-rule");
  EXPECT_EQ(astigmatism_type(61), "with-the-rule");
  EXPECT_EQ(astigmatism_type(119), "with-the-rule");
  EXPECT_EQ(astigmatism_type(45), "oblique");
  EXPECT_EQ(astigmatism_type(121), "oblique");
  EXPECT_EQ(astigmatism_type(175), "against-the-rule");
  EXPECT_EQ(astigmatism_type(30), "against-the-rule");
}

}  // namespace
}  // namespace emmetrope
