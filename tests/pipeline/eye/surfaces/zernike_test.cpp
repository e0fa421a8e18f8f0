#include "pipeline/eye/surfaces/zernike.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace emmetrope {
namespace {

TEST(Zernike, IndexFollowsAnsi) {
  const int expected[][2] = {{0, 0}, {1, -1}, {1, 1},  {2, -2}, {2, 0}, {2, 2}, {3, -3}, {3, -1},
                             {3, 1}, {3, 3},  {4, -4}, {4, -2}, {4, 0}, {4, 2}, {4, 4}};
  for (int j = 0; j < 15; ++j) {
    EXPECT_EQ(zernike_index(j).n, expected[j][0]) << j;
    EXPECT_EQ(zernike_index(j).m, expected[j][1]) << j;
  }
}

TEST(Zernike, LowTermsAreThePublishedPolynomials) {
  const double x = 0.3, y = -0.5, r2 = x * x + y * y;
  const Eigen::VectorXd z = zernike_values(6, x, y);
  EXPECT_NEAR(z[1], 2 * y, 1e-14);
  EXPECT_NEAR(z[2], 2 * x, 1e-14);
  EXPECT_NEAR(z[3], std::sqrt(6.0) * 2 * x * y, 1e-14);
  EXPECT_NEAR(z[4], std::sqrt(3.0) * (2 * r2 - 1), 1e-14);
  EXPECT_NEAR(z[5], std::sqrt(6.0) * (x * x - y * y), 1e-14);
  EXPECT_NEAR(z[7], std::sqrt(8.0) * (3 * r2 - 2) * y, 1e-14);
  EXPECT_NEAR(z[12], std::sqrt(5.0) * (6 * r2 * r2 - 6 * r2 + 1), 1e-14);
  EXPECT_NEAR(z[24], std::sqrt(7.0) * (20 * r2 * r2 * r2 - 30 * r2 * r2 + 12 * r2 - 1), 1e-13);
}

TEST(Zernike, TermsAreOrthonormalOverTheCircle) {
  constexpr int order = 10, rings = 60, spokes = 48;
  const int count = zernike_count(order);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(count, count);
  for (int i = 0; i < rings; ++i)
    for (int k = 0; k < spokes; ++k) {
      const double rho = std::sqrt((i + 0.5) / rings), angle = 2 * M_PI * k / spokes;
      const Eigen::VectorXd z = zernike_values(order, rho * std::cos(angle), rho * std::sin(angle));
      gram += z * z.transpose() / (rings * spokes);
    }
  // The midpoint rule over rho^2 leaves an error of order (n / rings)^2.
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(count, count)).cwiseAbs().maxCoeff(), 0.15);
  EXPECT_LT((gram.topLeftCorner(15, 15) - Eigen::MatrixXd::Identity(15, 15)).cwiseAbs().maxCoeff(), 5e-3);
}

TEST(Zernike, GradientIsTheDerivative) {
  constexpr double h = 1e-6;
  for (int j = 0; j < zernike_count(8); ++j)
    for (const auto& [x, y] : {std::pair{0.0, 0.0}, {0.4, -0.3}, {-0.7, 0.6}}) {
      const ZernikeJet jet = zernike_jet(j, x, y);
      EXPECT_NEAR(jet.value, zernike_values(8, x, y)[j], 1e-13);
      EXPECT_NEAR(jet.gradient.x(),
                  (zernike_jet(j, x + h, y).value - zernike_jet(j, x - h, y).value) / (2 * h), 1e-7);
      EXPECT_NEAR(jet.gradient.y(),
                  (zernike_jet(j, x, y + h).value - zernike_jet(j, x, y - h).value) / (2 * h), 1e-7);
    }
}

}  // namespace
}  // namespace emmetrope
