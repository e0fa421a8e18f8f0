#include "segmentation/fit/patient_frame.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "pipeline/base/even_points.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// A regular cornea with a cylinder, an aspheric globe with a bulging wall.
class AlongPatient : public testing::TestWithParam<int> {
 protected:
  static ParameterLayout layout() {
    ParameterLayout layout;
    layout.bumps = static_cast<int>(bump_directions().size());
    return layout;
  }
  static VectorXd parameters(unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    VectorXd a = population_mean(layout());
    a.segment<5>(0) << 30, -60, 10, 12 * normal(random), 10 * normal(random);
    a.segment<3>(globe_x) << 12.4, 11.5, 11.8;
    a[cornea_j0] = 0.004;
    a[cornea_j45] = -0.003;
    a[cornea_q_split] = 0.08;
    a.segment<2>(lens_tilt_x) << 3, -2;
    a.segment<2>(lens_decentre_x) << 0.2, -0.1;
    a.segment<2>(lid_tilt_x) << 0.2, -0.3;
    a[lid_xy] = 0.02;
    for (int i = 0; i < layout().bumps; ++i) {
      a[layout().displacement() + i] = 0.06 * normal(random);
      a[layout().background() + i] = 0.1 * normal(random);
    }
    return a;
  }
  static EyeFit fit(unsigned seed) {
    const double by_deg = GetParam();
    const Matrix3d head =
        Eigen::AngleAxisd(by_deg * degree, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    EyeFit fit{layout(),
               Weighting::t1,
               {},
               ForwardModel(layout(), {{Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()}}, {0, 0, 0})
                   .along(head)};
    fit.parameters = parameters(seed);
    fit.priors = {fit.parameters, VectorXd::Ones(layout().size())};
    for (int i = apex_x; i <= surround; ++i) fit.active.push_back(i);
    fit.covariance = Eigen::MatrixXd::Identity(surround + 1, surround + 1) * 1e-4;
    return fit;
  }
};

TEST_P(AlongPatient, TheEyeIsWhereItWas) {
  const EyeFit before = fit(static_cast<unsigned>(GetParam())), after = along_patient(before);
  EXPECT_TRUE(after.model.head_axes().isIdentity());
  const ForwardModel::AtParameters was(before.model, before.parameters), is(after.model, after.parameters);
  const Vector3d globe = before.globe_centre_lps();
  EXPECT_LT((after.globe_centre_lps() - globe).norm(), 1e-9);
  EXPECT_LT((after.model.axis(after.parameters) - before.model.axis(before.parameters)).norm(), 1e-9);
  double squares = 0;
  int count = 0;
  for (const Vector3d& direction : mirrored_directions(700)) {
    const Vector3d lps = globe + 11.5 * direction, p = was.to_eye(lps, 0), q = is.to_eye(lps, 0);
    const auto a = was.distances(p), b = is.distances(q);
    EXPECT_NEAR(p.z(), q.z(), 1e-9);
    EXPECT_NEAR(a.lens, b.lens, 1e-3);
    EXPECT_NEAR(a.lid, b.lid, 1e-9);
    if (p.head<2>().norm() < 4 && p.z() > -4) {
      EXPECT_NEAR(a.cornea_front, b.cornea_front, 1e-9);
    }
    if (p.z() > -6) continue;  // of the front of the globe no wall is fitted
    EXPECT_NEAR(a.globe, b.globe, 0.04);
    squares += std::pow(a.globe - b.globe, 2);
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 0.01);
}

TEST_P(AlongPatient, WhatHasNoDirectionAcrossTheEyeIsAsSure) {
  const EyeFit before = fit(7), after = along_patient(before);
  for (const Parameter parameter : {cornea_c, axial_length, anterior_chamber_depth, lens_thickness, globe_z})
    EXPECT_NEAR(after.sigma(parameter), before.sigma(parameter), 1e-9);
  // A cylinder as sure both ways stays so, turned.
  EXPECT_NEAR(std::hypot(after.value(cornea_j0), after.value(cornea_j45)), 0.005, 1e-9);
  EXPECT_NEAR(after.sigma(cornea_j0), before.sigma(cornea_j0), 1e-4);
}

/// Against eyes drawn as the covariance has it and turned one by one.
TEST_P(AlongPatient, TheCovarianceIsThatOfTurnedEyes) {
  constexpr int eyes = 500;
  EyeFit before = fit(3);
  before.active = {globe_x, globe_y, globe_z, cornea_j0, cornea_j45, lens_tilt_x, lens_tilt_y};
  for (int i = 0; i < layout().bumps; ++i) before.active.push_back(layout().displacement() + i);
  const auto count = static_cast<Eigen::Index>(before.active.size());
  VectorXd sigmas = VectorXd::Constant(count, 0.05);
  sigmas.head<7>() << 0.02, 0.05, 0.03, 5e-4, 2e-4, 1, 0.3;
  before.covariance = sigmas.cwiseAbs2().asDiagonal();
  const EyeFit after = along_patient(before);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd drawn(eyes, count);
  for (int e = 0; e < eyes; ++e) {
    EyeFit eye = before;
    eye.active.clear();
    eye.covariance.resize(0, 0);
    for (Eigen::Index i = 0; i < count; ++i)
      eye.parameters[before.active[static_cast<std::size_t>(i)]] += sigmas[i] * normal(random);
    eye = along_patient(std::move(eye));
    for (Eigen::Index i = 0; i < count; ++i)
      drawn(e, i) = eye.value(before.active[static_cast<std::size_t>(i)]);
  }
  const Eigen::MatrixXd apart = drawn.rowwise() - drawn.colwise().mean(),
                        covariance = apart.transpose() * apart / (eyes - 1);
  for (Eigen::Index i = 0; i < count; ++i)
    for (Eigen::Index j = 0; j < count; ++j) {
      const double scale = std::sqrt(after.covariance(i, i) * after.covariance(j, j));
      EXPECT_NEAR(covariance(i, j), after.covariance(i, j), 5.5 / std::sqrt(eyes) * scale) << i << ' ' << j;
    }
}

INSTANTIATE_TEST_SUITE_P(TurnedBy, AlongPatient, testing::Values(0, 5, 20, 40));

}  // namespace
}  // namespace emmetrope::segmentation
