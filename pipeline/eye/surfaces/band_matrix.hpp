#pragma once
#include <Eigen/Cholesky>
#include <algorithm>

namespace emmetrope {

/// A symmetric positive definite matrix of a given half bandwidth, its lower band column by column: dense
/// blocks, which for the few thousand unknowns of a surface are quicker than a sparse factorisation.
class BandMatrix {
 public:
  BandMatrix(int size, int half_bandwidth)
      : size_(size), width_(half_bandwidth), stored_(Eigen::MatrixXd::Zero(half_bandwidth + block, size)) {}

  /// \pre 0 <= row - column <= half bandwidth
  double& operator()(int row, int column) { return stored_(row - column, column); }

  /// \pre positive definite
  /// \return x of A x = right
  Eigen::VectorXd solve(Eigen::VectorXd right) && {
    // Cholesky's factor takes the matrix's place, block of columns after block.
    for (int k = 0; k < size_; k += block) {
      const int columns = std::min(block, size_ - k), next = k + columns;
      const int below = std::min(width_, size_ - next);
      View diagonal = view(k, k, columns, columns);
      const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>> in_place(diagonal);
      if (below == 0) continue;
      View panel = view(next, k, below, columns);
      diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(panel);
      view(next, next, below, below).selfadjointView<Eigen::Lower>().rankUpdate(panel, -1);
    }
    for (int k = 0; k < size_; ++k) {
      const int below = std::min(width_, size_ - 1 - k);
      right[k] /= stored_(0, k);
      right.segment(k + 1, below) -= right[k] * stored_.col(k).segment(1, below);
    }
    for (int k = size_ - 1; k >= 0; --k) {
      const int below = std::min(width_, size_ - 1 - k);
      right[k] -= stored_.col(k).segment(1, below).dot(right.segment(k + 1, below));
      right[k] /= stored_(0, k);
    }
    return right;
  }

 private:
  static constexpr int block = 32;
  using View = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

  /// A part of the matrix as a dense one: a step to the right in the band is one row down. Of its places
  /// only those on and below the matrix's diagonal, at most `block` beyond the band, where zeros stand.
  View view(int row, int column, int rows, int columns) {
    const Eigen::Index stride = stored_.rows() - 1;
    return {stored_.data() + row + column * stride, rows, columns, Eigen::OuterStride<>(stride)};
  }

  int size_, width_;
  Eigen::MatrixXd stored_;
};

}  // namespace emmetrope
