#include "segmentation/fit/block_variance.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A linear model y = J x + error of unit noise, with a prior on x about 0.
struct LinearModel {
  MatrixXd jacobian;
  VectorXd prior_sigma;

  MatrixXd covariance() const {
    const MatrixXd hessian =
        jacobian.transpose() * jacobian + MatrixXd(prior_sigma.cwiseAbs2().cwiseInverse().asDiagonal());
    return hessian.inverse();
  }
  VectorXd fit(const VectorXd& y) const { return covariance() * (jacobian.transpose() * y); }
  LinearRows rows_at_fit(const VectorXd& y) const {
    return {Eigen::SparseMatrix<double, Eigen::RowMajor>((-jacobian).sparseView()), y - jacobian * fit(y)};
  }
};

LinearModel mean_of(Index samples) { return {MatrixXd::Ones(samples, 1), VectorXd::Constant(1, 1e6)}; }

/// Samples in a rectangle of rows by columns by repeats, and the blocks that rows and columns are.
struct Grid {
  Blocks row, column;
  Grid(int rows, int columns, int repeats) {
    for (int i = 0; i < rows * columns * repeats; ++i) {
      row.push_back(i / repeats / columns);
      column.push_back(i / repeats % columns);
    }
  }
  /// Noise of each sample, and errors that the samples of a row and those of a column have in common.
  VectorXd errors(std::mt19937_64& random, double noise, double of_row, double of_column) const {
    std::normal_distribution<double> normal;
    VectorXd by_row(row.back() + 1), by_column(column.back() + 1), sum(static_cast<Index>(row.size()));
    for (double& value : by_row) value = of_row * normal(random);
    for (double& value : by_column) value = of_column * normal(random);
    for (std::size_t i = 0; i < row.size(); ++i)
      sum[static_cast<Index>(i)] = noise * normal(random) + by_row[row[i]] + by_column[column[i]];
    return sum;
  }
};

/// Of a mean it is the variance of the blocks' means over their number.
TEST(BlockVariance, OfAMeanIsTheVarianceOfBlockMeans) {
  const Grid grid(8, 1, 5);
  std::mt19937_64 random(1);
  const VectorXd y = grid.errors(random, 1, 2, 0);
  const LinearModel model = mean_of(y.size());
  const VectorXd block_means = Eigen::Map<const MatrixXd>(y.data(), 5, 8).colwise().mean().transpose();
  const double expected = (block_means.array() - block_means.mean()).square().sum() / 7 / 8;
  const BlockVariance variance =
      block_variance(model.rows_at_fit(y), model.covariance(), grid.row, MatrixXd::Ones(1, 1));
  EXPECT_NEAR(variance.unbiased[0], expected, 1e-9 * expected);
  EXPECT_NEAR(variance.jackknife[0], expected, 1e-9 * expected);
}

/// Random parameters' worth of data in blocks smaller and larger than the number of parameters.
struct UnevenBlocks {
  std::mt19937_64 random{2};
  LinearModel model{normal(60, 12), VectorXd::Constant(12, 0.7)};
  MatrixXd figures = normal(12, 3);
  Blocks blocks;
  UnevenBlocks() {
    for (int i = 0; i < 60; ++i) blocks.push_back(i < 30 ? 0 : 1 + (i - 30) / 5);
  }
  MatrixXd normal(Index rows, Index columns) {
    return MatrixXd::NullaryExpr(rows, columns,
                                 [this] { return std::normal_distribution<double>()(random); });
  }
};

/// Against fits that really leave a block out, and fits whose residuals in the block are undone.
TEST(BlockVariance, IsWhatFitsWithoutABlockGive) {
  UnevenBlocks data;
  const VectorXd y = data.normal(60, 1), solution = data.model.fit(y);
  VectorXd unbiased = VectorXd::Zero(3), jackknife = VectorXd::Zero(3);
  for (int block = 0; block < 7; ++block) {
    LinearModel without = data.model;
    VectorXd kept = y, undone = y;
    for (Index i = 0; i < y.size(); ++i) {
      if (data.blocks[i] != block) continue;
      without.jacobian.row(i).setZero();
      kept[i] = 0;
      undone[i] = data.model.jacobian.row(i) * solution;
    }
    const VectorXd left_out = data.figures.transpose() * (without.fit(kept) - solution),
                   by_it = data.figures.transpose() * (data.model.fit(undone) - solution);
    unbiased += left_out.cwiseProduct(by_it);
    jackknife += left_out.cwiseAbs2() * 6.0 / 7;
  }
  const BlockVariance variance =
      block_variance(data.model.rows_at_fit(y), data.model.covariance(), data.blocks, data.figures);
  EXPECT_LT((variance.unbiased - unbiased).cwiseQuotient(unbiased).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((variance.jackknife - jackknife).cwiseQuotient(jackknife).cwiseAbs().maxCoeff(), 1e-9);
}

/// One block is half of all data. Means over 4000 draws, to three standard errors.
TEST(BlockVariance, OfIndependentErrorsIsUnbiasedWhateverABlocksShare) {
  UnevenBlocks data;
  const MatrixXd covariance = data.model.covariance();
  const VectorXd expected =
      (data.model.jacobian * covariance * data.figures).colwise().squaredNorm().transpose();
  constexpr int times = 4000;
  VectorXd sum = VectorXd::Zero(3), squares = VectorXd::Zero(3), jackknife = VectorXd::Zero(3);
  for (int i = 0; i < times; ++i) {
    // The prior is the truth's distribution.
    const VectorXd y = data.model.jacobian * (0.7 * data.normal(12, 1)) + data.normal(60, 1);
    const BlockVariance variance =
        block_variance(data.model.rows_at_fit(y), covariance, data.blocks, data.figures);
    sum += variance.unbiased;
    squares += variance.unbiased.cwiseAbs2();
    jackknife += variance.jackknife;
  }
  const VectorXd mean = sum / times, error = ((squares / times - mean.cwiseAbs2()) / times).cwiseSqrt();
  for (Index i = 0; i < 3; ++i) {
    EXPECT_LT(error[i], 0.03 * expected[i]);
    EXPECT_NEAR(mean[i], expected[i], 3 * error[i]) << i;
    EXPECT_GT(jackknife[i] / times, 1.2 * expected[i]) << i;
  }
}

struct Repeated {
  double stated_variance = 0;  ///< mean
  double model_variance = 0;
  double true_variance = 0;
  double covered = 0;  ///< share of 95 % intervals
};
/// A mean whose errors are coherent in rows and columns.
Repeated repeat(double of_row, double of_column) {
  constexpr int rows = 20, columns = 30, repeats = 2, times = 400;
  const Grid grid(rows, columns, repeats);
  const LinearModel model = mean_of(Index{rows} * columns * repeats);
  std::mt19937_64 random(3);
  Repeated result;
  result.model_variance = model.covariance()(0, 0);
  result.true_variance = result.model_variance + of_row * of_row / rows + of_column * of_column / columns;
  for (int i = 0; i < times; ++i) {
    const VectorXd y = grid.errors(random, 1, of_row, of_column);
    const double variance = widened_for_blocks(model.rows_at_fit(y), model.covariance(), grid.row,
                                               grid.column, MatrixXd::Ones(1, 1))(0, 0);
    EXPECT_GE(variance, result.model_variance * (1 - 1e-9));
    result.stated_variance += variance / times;
    result.covered += std::abs(model.fit(y)[0]) < 1.96 * std::sqrt(variance) ? 1.0 / times : 0;
  }
  return result;
}

/// Variances of the block means have 19 and 29 degrees of freedom: their mean over 400 fits is known to 2 %,
/// and a normal 95 % interval with them covers 93 to 95 %, +- 2.5 %.
TEST(BlockVariance, IntervalsCoverErrorsThatAreCoherentInTwoWays) {
  const Repeated coherent = repeat(0.3, 0.2);
  EXPECT_GT(coherent.true_variance, 7 * coherent.model_variance);
  EXPECT_NEAR(coherent.stated_variance / coherent.true_variance, 1, 0.06);
  EXPECT_NEAR(coherent.covered, 0.94, 0.03);
}

/// White noise: what is widened is the estimate's own noise, whose positive half alone counts. Its variance
/// is 2/19 + 2/29 (the intersection's, with 599, is known); half the mean deviation of that is 0.17.
TEST(BlockVariance, WhiteNoiseIsNotWidenedButByTheEstimatesNoise) {
  const Repeated white = repeat(0, 0);
  EXPECT_NEAR(white.stated_variance / white.model_variance, 1.17, 0.06);
  EXPECT_GT(white.covered, 0.93);
}

/// The more of the jackknife's the surer it is that residuals are coherent, and at least 1.
TEST(BlockVariance, LeavingOutDecidesWhereCoherenceIsEvident) {
  UnevenBlocks data;
  const MatrixXd before = data.model.covariance();
  const VectorXd figure = data.figures.col(0);
  Blocks samples;  // as the second kind of block: these cancel
  for (int i = 0; i < 60; ++i) samples.push_back(i);
  const double stated = figure.dot(before * figure),
               by_samples = (data.model.jacobian * (before * figure)).squaredNorm();
  int none = 0, some = 0, all = 0;
  for (int i = 0; i < 400; ++i) {
    const VectorXd of_block = data.normal(7, 1);
    VectorXd y = data.normal(60, 1);
    for (Index j = 0; j < 60 && i % 2 == 1; ++j) y[j] += 2 * of_block[data.blocks[j]];
    const LinearRows rows = data.model.rows_at_fit(y);
    const BlockVariance variance = block_variance(rows, before, data.blocks, figure);
    const double unbiased = (stated - by_samples + variance.unbiased[0]) / stated,
                 jackknife = (stated - by_samples + variance.jackknife[0]) / stated,
                 widened =
                     figure.dot(widened_for_blocks(rows, before, data.blocks, samples, figure) * figure) /
                     stated;
    if (unbiased <= 1) {
      EXPECT_NEAR(widened, 1, 1e-9);
      ++none;
    } else if (unbiased < 1.5) {
      EXPECT_NEAR(widened, unbiased + (unbiased - 1) / 0.5 * std::max(0.0, jackknife - unbiased), 1e-9);
      ++some;
    } else {
      EXPECT_NEAR(widened, std::max(unbiased, jackknife), 1e-9);
      ++all;
    }
  }
  EXPECT_GT(none, 50);
  EXPECT_GT(some, 20);
  EXPECT_GT(all, 50);
}

/// A figure's error is added to what it is made of, and to nothing else.
TEST(BlockVariance, WhatDoesNotMoveTheFigureStays) {
  const Grid grid(10, 12, 1);
  std::mt19937_64 random(5);
  const auto normal = [&random] { return std::normal_distribution<double>()(random); };
  const LinearModel model{MatrixXd::NullaryExpr(120, 2, normal) + MatrixXd::Ones(120, 2),
                          VectorXd::Constant(2, 3.0)};
  const VectorXd y = grid.errors(random, 1, 2, 2);
  const VectorXd figure = VectorXd::LinSpaced(2, 1, 2), other = VectorXd::LinSpaced(2, 2, -1);
  const MatrixXd before = model.covariance(),
                 after = widened_for_blocks(model.rows_at_fit(y), before, grid.row, grid.column, figure);
  EXPECT_GT(figure.dot(after * figure), 2 * figure.dot(before * figure));
  EXPECT_NEAR(other.dot(after * other), other.dot(before * other), 1e-12);
  EXPECT_NEAR(other.dot(after * figure), other.dot(before * figure), 1e-12);
}

}  // namespace
}  // namespace emmetrope::segmentation
