#include "raytrace/case/retina_ellipse.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/chief_ray.hpp"
#include "raytrace/retina/retina_arc.hpp"
#include "tests/support/measured_optics.hpp"

namespace emmetrope::raytrace {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Vector3d towards(double x_deg, double y_deg) {
  return Vector3d(std::tan(x_deg * degree), std::tan(y_deg * degree), 1).normalized();
}

TEST(RetinaEllipse, HoldsNineteenOfTwentyEyesThatAreAsLikely) {
  const UncertainOptics optics = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const std::vector<Vector3d> directions{towards(0, 0), towards(25, -10), towards(-40, 5)};
  const auto ellipses = retina_ellipses(
      optics, [](const EyeModel& eye) { return eye; }, directions, 555, 1);
  const NormalDistribution known = optics.known.parameters();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(known.covariance);
  const Eigen::MatrixXd root = axes.eigenvectors() * axes.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  constexpr int draws = 400;
  std::vector<int> inside(directions.size());
  std::vector<Vector3d> means;
  // On the retina, from its own pole's depth.
  const auto seen_by = [](const EyeModel& eye, const Vector3d& direction) -> Vector3d {
    return ChiefRays(eye, 555).image_of(direction)->position_mm + Vector3d(0, 0, eye.axial_length_mm());
  };
  for (const Vector3d& direction : directions)
    means.push_back(seen_by(eye_at(optics, known.mean), direction));
  for (int draw = 0; draw < draws; ++draw) {
    const Eigen::VectorXd unit =
        Eigen::VectorXd::NullaryExpr(known.mean.size(), [&] { return normal(random); });
    const EyeModel drawn = eye_at(optics, known.mean + root * unit);
    for (std::size_t k = 0; k < directions.size(); ++k) {
      // Of the point moved: away from the axis and across, which is along the retina up to its slope's cosine.
      const Vector3d moved = seen_by(drawn, directions[k]) - means[k];
      const Vector2d outward =
          means[k].head<2>().norm() > 1e-6 ? Vector2d(means[k].head<2>().normalized()) : Vector2d(1, 0);
      const double slope = means[k].head<2>().norm() > 1e-6 ? moved.z() : 0;
      const double away =
          std::copysign(std::hypot(moved.head<2>().dot(outward), slope), moved.head<2>().dot(outward));
      const double across = outward.x() * moved.y() - outward.y() * moved.x();
      // Looked at from within, with +z towards the viewer, counter-clockwise is from away to across.
      const double axis = ellipses[k]->axis_deg * degree;
      const double along = std::cos(axis) * away + std::sin(axis) * across,
                   beside = -std::sin(axis) * away + std::cos(axis) * across;
      inside[k] +=
          std::hypot(along / ellipses[k]->semi_axes_mm.x(), beside / ellipses[k]->semi_axes_mm.y()) < 1;
    }
  }
  // 95 % of 400 with the binomial's three standard deviations, and two hundredths for curvature and length.
  for (const int count : inside) EXPECT_NEAR(count / static_cast<double>(draws), 0.95, 0.033 + 0.02);
  EXPECT_GE(ellipses[1]->semi_axes_mm.x(), ellipses[1]->semi_axes_mm.y());
  // Magnification is what is least known: further out the ellipse is larger, and lies along the way from the pole.
  EXPECT_GT(ellipses[2]->semi_axes_mm.x(), ellipses[0]->semi_axes_mm.x());
}

TEST(RetinaEllipse, OfTheLengthAloneIsWhatDistancesFromThePoleChangeBy) {
  Json json = measured_optics();
  std::size_t length = 0;
  while (json["parameters"][length] != "optical_axial_length_mm") ++length;
  for (auto& row : json["covariance"])
    for (auto& number : row) number = 0.0;
  json["covariance"][length][length] = 0.01;  // 0.1 mm
  const UncertainOptics optics = uncertain_optics_from_json(json, ".", 0);
  const Vector3d direction = towards(60, 0);
  const auto ellipse = retina_ellipses(
                           optics, [](const EyeModel& eye) { return eye; }, {direction}, 555, 1)
                           .front();
  const auto arc_mm = [&](double off_mm) {
    Eigen::VectorXd values = optics.known.parameters().mean;
    values[optics.known.index_of("axial_length_mm")] += off_mm;
    const EyeModel eye = eye_at(optics, values);
    return *retina_arc_mm(eye, ChiefRays(eye, 555).image_of(direction)->position_mm);
  };
  const double sigma_mm = std::abs(arc_mm(0.1) - arc_mm(-0.1)) / 2;
  ASSERT_TRUE(ellipse);
  EXPECT_NEAR(ellipse->semi_axes_mm.x(), 2.4477 * sigma_mm, 0.02 * 2.4477 * sigma_mm);
}

TEST(RetinaEllipse, IsNotWhereTheEyeDoesNotSee) {
  const UncertainOptics optics = uncertain_optics_from_json(measured_optics(), ".", 0.005);
  const auto ellipses = retina_ellipses(
      optics, [](const EyeModel& eye) { return eye; }, {Vector3d(0, 0, -1)}, 555, 1);
  EXPECT_FALSE(ellipses[0]);
}

}  // namespace
}  // namespace emmetrope::raytrace
