#include "segmentation/fit/block_jackknife.hpp"

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

VectorXd jackknife_variance(const LinearRows& rows, const MatrixXd& covariance, const Blocks& blocks,
                            const MatrixXd& figures) {
  const MatrixXd hessian = covariance.llt().solve(MatrixXd::Identity(covariance.rows(), covariance.cols()));
  const std::vector<std::vector<Index>> list = members(blocks);
  VectorXd sum = VectorXd::Zero(figures.cols());
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
    VectorXd step;
    if (count < jacobian.cols()) {
      // (H - J'J)^-1 J' = C J' (I - J C J')^-1, the smaller matrix.
      const MatrixXd spread = jacobian * covariance;
      const MatrixXd left = MatrixXd::Identity(count, count) - jacobian * spread.transpose();
      step = spread.transpose() * left.ldlt().solve(residual);
    } else {
      const MatrixXd left = hessian - MatrixXd(jacobian.transpose() * jacobian);
      step = left.ldlt().solve(jacobian.transpose() * residual);
    }
    sum += (figures.transpose() * step).cwiseAbs2();
  }
  const auto count = static_cast<double>(list.size());
  return (count - 1) / count * sum;
}

MatrixXd widened_for_blocks(const LinearRows& rows, const MatrixXd& covariance, const Blocks& first,
                            const Blocks& second, const MatrixXd& figures) {
  const auto variance = [&](const Blocks& blocks) {
    return jackknife_variance(rows, covariance, blocks, figures);
  };
  const MatrixXd by_figure = covariance * figures, before = figures.transpose() * by_figure;
  const VectorXd from_samples = (rows.jacobian * by_figure).colwise().squaredNorm().transpose();
  const VectorXd after = before.diagonal() - from_samples + variance(first) + variance(second) -
                         variance(intersection(first, second));
  const double widening = std::max(1.0, after.cwiseQuotient(before.diagonal()).mean());
  const MatrixXd error = figures * (figures.transpose() * figures).inverse();
  return covariance + (widening - 1) * error * before * error.transpose();
}

}  // namespace emmetrope::segmentation
