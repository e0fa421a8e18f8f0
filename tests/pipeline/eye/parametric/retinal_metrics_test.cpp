#include "pipeline/eye/parametric/retinal_metrics.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "tests/support/nelder_mead.hpp"

namespace emmetrope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

InterfaceDistance sphere(double radius_mm) {
  return [radius_mm](const Vector3d&) { return radius_mm; };
}

/// An ellipsoid whose axes are the columns of `turn`, with its centre off the globe's.
InterfaceDistance ellipsoid(const Vector3d& half_axes_mm, const Matrix3d& turn = Matrix3d::Identity(),
                            const Vector3d& centre_mm = Vector3d::Zero()) {
  const Matrix3d a = turn * half_axes_mm.cwiseAbs2().cwiseInverse().asDiagonal() * turn.transpose();
  return [a, centre_mm](const Vector3d& d) {
    const double dd = d.dot(a * d), dc = d.dot(a * centre_mm), cc = centre_mm.dot(a * centre_mm);
    return (dc + std::sqrt(dc * dc - dd * (cc - 1))) / dd;
  };
}

double spheroid_cap_area_mm2(double across_mm, double along_mm, double half_angle_rad) {
  // By rings of the surface of revolution, independent of the quadrature under test.
  constexpr int steps = 200000;
  double area = 0;
  const auto place = [&](double angle) {
    const double distance = 1 / std::hypot(std::sin(angle) / across_mm, std::cos(angle) / along_mm);
    return Eigen::Vector2d(distance * std::sin(angle), distance * std::cos(angle));
  };
  for (int i = 0; i < steps; ++i) {
    const Eigen::Vector2d p = place(half_angle_rad * i / steps), q = place(half_angle_rad * (i + 1) / steps);
    area += pi * (p.x() + q.x()) * (q - p).norm();
  }
  return area;
}

TEST(RetinalMetrics, OfASphereAreItsOwn) {
  const double radius = 11.3;
  for (const double cap_deg : {120.0, 240.0}) {
    const BestEllipsoid best = best_ellipsoid(sphere(radius), cap_deg);
    EXPECT_NEAR(best.vertex_radius_mm.x(), radius, 1e-6);
    EXPECT_NEAR(best.vertex_radius_mm.y(), radius, 1e-6);
    EXPECT_NEAR(best.q, 0, 1e-6);
    EXPECT_NEAR(retinal_area_mm2(sphere(radius), cap_deg),
                2 * pi * radius * radius * (1 - std::cos(cap_deg / 2 * degree)), 1e-6);
    EXPECT_NEAR(rim_tilt_deg(sphere(radius), cap_deg).norm(), 0, 1e-9);
  }
  EXPECT_NEAR(macular_curvature_index(sphere(radius)), 337.5 / radius, 1e-9);
  EXPECT_NEAR(globe_extent_mm(sphere(radius), Vector3d::UnitZ()), 2 * radius, 1e-9);
  for (const double eccentricity : {0.0, 0.5, 1.0})
    EXPECT_NEAR(mean_curvature_per_mm(sphere(radius), retinal_direction(eccentricity, 2)), 1 / radius, 1e-5);
}

TEST(RetinalMetrics, OfEllipsoidsAreRadiusAndAsphericityAtTheVertex) {
  const Vector3d half(11.8, 11.2, 12.4);
  for (const double cap_deg : {120.0, 240.0}) {
    const BestEllipsoid best = best_ellipsoid(ellipsoid(half), cap_deg);
    EXPECT_NEAR(best.vertex_radius_mm.x(), 11.8 * 11.8 / 12.4, 1e-5);
    EXPECT_NEAR(best.vertex_radius_mm.y(), 11.2 * 11.2 / 12.4, 1e-5);
    EXPECT_NEAR(best.q, (11.8 * 11.8 + 11.2 * 11.2) / (2 * 12.4 * 12.4) - 1, 1e-6);
    EXPECT_NEAR(best.axis_deg.norm(), 0, 1e-4);
  }
  EXPECT_NEAR(mean_curvature_per_mm(ellipsoid(half), -Vector3d::UnitZ()),
              (12.4 / (11.8 * 11.8) + 12.4 / (11.2 * 11.2)) / 2, 1e-5);
  // The sharpest section through the pole lies in the vertical meridian.
  EXPECT_NEAR(macular_curvature_index(ellipsoid(half)), 337.5 * 12.4 / (11.2 * 11.2), 0.01);
  EXPECT_NEAR(globe_extent_mm(ellipsoid(half), Vector3d::UnitX()), 23.6, 1e-6);
}

TEST(RetinalMetrics, FindTheAxisOfATiltedEllipsoidThatIsOffCentre) {
  // 8 degrees to the patient's left, 5 up.
  const Vector3d axis = Vector3d(std::tan(8 * degree), std::tan(5 * degree), 1).normalized();
  const Matrix3d turn = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
  for (const double cap_deg : {120.0, 240.0}) {
    const BestEllipsoid best = best_ellipsoid(ellipsoid({11.2, 11.2, 12.4}, turn, {0.2, -0.3, 0.4}), cap_deg);
    EXPECT_NEAR(best.axis_deg.x(), 8, 1e-3);
    EXPECT_NEAR(best.axis_deg.y(), 5, 1e-3);
    EXPECT_NEAR(best.q, std::pow(11.2 / 12.4, 2) - 1, 1e-6);
    EXPECT_NEAR(best.vertex_radius_mm.x(), 11.2 * 11.2 / 12.4, 1e-5);
  }
}

/// A surface of revolution that is no ellipsoid: of all spheroids about the axis that with the least mean square of
/// distances, sought without derivatives.
TEST(RetinalMetrics, TheBestEllipsoidOfAWavyInterfaceIsTheNearest) {
  for (const double wave_mm : {-0.15, 0.1}) {
    const auto distance_mm = [&](double from_pole_rad) {
      return 11.5 + 0.4 * std::cos(2 * from_pole_rad) + wave_mm * std::cos(6 * from_pole_rad);
    };
    const InterfaceDistance interface = [&](const Vector3d& d) {
      return distance_mm(std::acos(std::clamp(-d.normalized().z(), -1.0, 1.0)));
    };
    // Of the half axes across and along, and the centre.
    const auto squared = [&](const Eigen::VectorXd& spheroid) {
      constexpr int rings = 400;
      double sum = 0;
      for (int i = 0; i < rings; ++i) {
        const double from_pole = (i + 0.5) / rings * 60 * degree, reach = distance_mm(from_pole);
        const double x = reach * std::sin(from_pole), z = -reach * std::cos(from_pole) - spheroid[2];
        const double a = 1 / (spheroid[0] * spheroid[0]), c = 1 / (spheroid[1] * spheroid[1]);
        const double left = a * x * x + c * z * z - 1;
        sum += std::sin(from_pole) * left * left / (4 * (a * a * x * x + c * c * z * z));
      }
      return sum;
    };
    const auto nearest = correction::nelder_mead(squared, Vector3d(11.5, 11.9, 0), 0.5, 1e-8).position;
    const BestEllipsoid best = best_ellipsoid(interface, 120);
    EXPECT_NEAR(best.q, std::pow(nearest[0] / nearest[1], 2) - 1, 0.02) << wave_mm;
    EXPECT_NEAR(best.vertex_radius_mm.x(), nearest[0] * nearest[0] / nearest[1], 0.02) << wave_mm;
  }
}

TEST(RetinalMetrics, AreaOfASpheroidIsThatOfItsRings) {
  for (const auto& [across, along] : {std::pair{11.5, 12.5}, std::pair{12.0, 10.5}})
    EXPECT_NEAR(retinal_area_mm2(ellipsoid({across, across, along}), 240),
                spheroid_cap_area_mm2(across, along, 120 * degree), 0.05);
}

TEST(RetinalMetrics, TiltOfARimIsItsPlanes) {
  // A sphere about another centre: its rim is cut by a cone about the globe's, and lies nearly in a plane across the
  // line between the centres.
  const auto moved = ellipsoid({11, 11, 11}, Matrix3d::Identity(), {0.5, 0, 0});
  const Eigen::Vector2d tilt = rim_tilt_deg(moved, 120);
  // At +-60 degrees in the horizontal meridian distances are R +- 0.5 sin 60 to first order.
  const double depth = 0.5 * std::sin(60 * degree) * std::cos(60 * degree),
               width = 11 * std::sin(60 * degree);
  EXPECT_NEAR(tilt.x(), std::atan2(depth, width) / degree, 0.05);
  EXPECT_NEAR(tilt.y(), 0, 1e-9);
}

TEST(RetinalMetrics, VitreousIsTheGlobeBehindThePlaneWithoutTheLens) {
  const double radius = 11, centre_depth = 12.8;
  const LensBack lens{7.2, 6, -1, 4.6};
  const double sagitta = 4.6 * 4.6 / 12;                // of a paraboloid
  const double plane = centre_depth - (7.2 - sagitta);  // before the centre
  const double cut_off = radius - plane;
  const double globe = 4 / 3.0 * pi * std::pow(radius, 3) - pi * cut_off * cut_off * (radius - cut_off / 3);
  const double lens_part = pi * 4.6 * 4.6 * sagitta / 2;
  EXPECT_NEAR(vitreous_volume_mm3(sphere(radius), centre_depth, lens), globe - lens_part, 0.01);
  // A back that ends before the equator that was asked for: a hemisphere.
  const LensBack ball{9.2, 4, 0, 4.6};
  const double before = radius - (centre_depth - 5.2);
  EXPECT_NEAR(
      vitreous_volume_mm3(sphere(radius), centre_depth, ball),
      4 / 3.0 * pi * std::pow(radius, 3) - pi * before * before * (radius - before / 3) - 2 / 3.0 * pi * 64,
      0.01);
}

TEST(RetinalMetrics, ABulgeAtThePoleIsSeenByItsCurvature) {
  // rho = R + h exp(-t^2/2w^2): at the pole the curvature is 1/R' + h/(w^2 R'^2), R' = R + h.
  ParametricEye eye;
  eye.globe_semi_axes_mm = {11, 11, 11};
  eye.displacement_directions = {-Vector3d::UnitZ()};
  eye.displacement_mm = {0.9};
  const double reach = 11.9, expected = 1 / reach + 0.9 / (0.09 * reach * reach);
  const InterfaceDistance interface = vitreoretinal_interface(eye);
  EXPECT_NEAR(interface(-Vector3d::UnitZ()), reach, 1e-9);
  EXPECT_NEAR(macular_curvature_index(interface), 337.5 * expected, 337.5 * expected * 0.004);
  EXPECT_NEAR(mean_curvature_per_mm(interface, -Vector3d::UnitZ()), expected, 0.002 * expected);
  EXPECT_GT(macular_curvature_index(interface), 40);  // a staphyloma
  EXPECT_LT(macular_curvature_index(sphere(reach)), 37.5);
  const BestSphere best = best_sphere(interface, 120);
  EXPECT_GT((reach * -Vector3d::UnitZ() - best.centre_mm).norm(), best.radius_mm + 0.1);
}

}  // namespace
}  // namespace emmetrope
