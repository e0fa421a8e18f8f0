#include "segmentation/fit/block_variance.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <map>

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;
using DenseRows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Of the unbiased widening, by how much it must be above 1 for residuals to be coherent beyond doubt;
/// chosen, as noise alone makes it 0.4 to 1.2 in phantoms, and it is 0.9 to 2.1 in real scans
/// (docs/method/segmentation.md, "Intervals").
constexpr double evident_excess = 0.5;

std::vector<std::vector<Index>> members(const Blocks& blocks) {
  std::vector<std::vector<Index>> list(blocks.empty() ? 0
                                                      : *std::max_element(blocks.begin(), blocks.end()) + 1);
  for (std::size_t i = 0; i < blocks.size(); ++i) list[blocks[i]].push_back(static_cast<Index>(i));
  return list;
}

}  // namespace

Blocks intersection(const Blocks& first, const Blocks& second) {
  std::map<std::pair<int, int>, int> number;
  Blocks both;
  both.reserve(first.size());
  for (std::size_t i = 0; i < first.size(); ++i)
    both.push_back(number.try_emplace({first[i], second[i]}, static_cast<int>(number.size())).first->second);
  return both;
}

BlockVariance block_variance(const LinearRows& rows, const MatrixXd& covariance, const Blocks& blocks,
                             const MatrixXd& figures) {
  const MatrixXd hessian = covariance.llt().solve(MatrixXd::Identity(covariance.rows(), covariance.cols()));
  const DenseRows covariance_rows = covariance;  // a sparse row times it adds up whole rows
  const MatrixXd covariance_with_figures = covariance * figures;
  const std::vector<std::vector<Index>> list = members(blocks);
  BlockVariance sum{VectorXd::Zero(figures.cols()), VectorXd::Zero(figures.cols())};
  for (const std::vector<Index>& block : list) {
    const auto count = static_cast<Index>(block.size());
    RowMatrix jacobian(count, rows.jacobian.cols());
    VectorXd residual(count);
    for (Index i = 0; i < count; ++i) {
      jacobian.startVec(i);
      for (RowMatrix::InnerIterator entry(rows.jacobian, block[i]); entry; ++entry)
        jacobian.insertBack(i, entry.col()) = entry.value();
      residual[i] = rows.residual[block[i]];
    }
    jacobian.finalize();
    VectorXd without;
    if (count < jacobian.cols()) {
      // (H - J'J)^-1 J' = C J' (I - J C J')^-1, the smaller matrix.
      const DenseRows spread = jacobian * covariance_rows;
      const MatrixXd left = MatrixXd::Identity(count, count) - jacobian * spread.transpose();
      without = spread.transpose() * left.ldlt().solve(residual);
    } else {
      const MatrixXd left = hessian - MatrixXd(jacobian.transpose() * jacobian);
      without = left.ldlt().solve(jacobian.transpose() * residual);
    }
    const VectorXd influence = covariance_with_figures.transpose() * (jacobian.transpose() * residual),
                   deletion = figures.transpose() * without;
    sum.unbiased += influence.cwiseProduct(deletion);
    sum.jackknife += deletion.cwiseAbs2();
  }
  const auto count = static_cast<double>(list.size());
  sum.jackknife *= (count - 1) / count;
  return sum;
}

MatrixXd widened_for_blocks(const LinearRows& rows, const MatrixXd& covariance, const Blocks& first,
                            const Blocks& second, const MatrixXd& figures) {
  const MatrixXd covariance_with_figures = covariance * figures,
                 before = figures.transpose() * covariance_with_figures;
  const VectorXd from_samples = (rows.jacobian * covariance_with_figures).colwise().squaredNorm().transpose();
  const BlockVariance of_first = block_variance(rows, covariance, first, figures),
                      of_second = block_variance(rows, covariance, second, figures),
                      of_both = block_variance(rows, covariance, intersection(first, second), figures);
  const auto mean_widening = [&](const VectorXd BlockVariance::*kind) {
    const VectorXd after =
        before.diagonal() - from_samples + of_first.*kind + of_second.*kind - of_both.*kind;
    return after.cwiseQuotient(before.diagonal()).mean();
  };
  const double unbiased = std::max(1.0, mean_widening(&BlockVariance::unbiased)),
               jackknife = std::max(unbiased, mean_widening(&BlockVariance::jackknife)),
               evidence = std::min(1.0, (unbiased - 1) / evident_excess),
               widening = unbiased + evidence * (jackknife - unbiased);
  const MatrixXd error = figures * (figures.transpose() * figures).inverse();
  return covariance + (widening - 1) * error * before * error.transpose();
}

}  // namespace emmetrope::segmentation
