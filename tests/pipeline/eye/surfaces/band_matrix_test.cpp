#include "pipeline/eye/surfaces/band_matrix.hpp"

#include <gtest/gtest.h>

#include <random>

namespace emmetrope {
namespace {

/// Diagonally dominant, so positive definite.
Eigen::MatrixXd random_band(int size, int half_bandwidth, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  for (int row = 0; row < size; ++row)
    for (int column = std::max(0, row - half_bandwidth); column <= row; ++column)
      matrix(row, column) = matrix(column, row) =
          row == column ? 2.0 * half_bandwidth + 1.5 + uniform(random) : uniform(random);
  return matrix;
}

TEST(BandMatrix, SolvesWhatTheDenseMatrixSolves) {
  std::mt19937 random(5);
  for (const auto& [size, half_bandwidth] :
       {std::pair{1, 0}, {1, 3}, {7, 2}, {31, 40}, {32, 31}, {33, 32}, {64, 1}, {200, 45}, {301, 160}}) {
    const Eigen::MatrixXd dense = random_band(size, half_bandwidth, random);
    BandMatrix band(size, half_bandwidth);
    for (int column = 0; column < size; ++column)
      for (int row = column; row <= std::min(size - 1, column + half_bandwidth); ++row)
        band(row, column) = dense(row, column);
    const Eigen::VectorXd wanted = Eigen::VectorXd::Random(size);
    const Eigen::VectorXd found = std::move(band).solve(dense * wanted);
    EXPECT_LT((found - wanted).norm(), 1e-12 * wanted.norm()) << size << " " << half_bandwidth;
  }
}

}  // namespace
}  // namespace emmetrope
