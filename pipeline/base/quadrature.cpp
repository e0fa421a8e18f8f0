#include "pipeline/base/quadrature.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace emmetrope {

Quadrature gauss_legendre(int nodes) {
  Eigen::MatrixXd jacobi = Eigen::MatrixXd::Zero(nodes, nodes);
  for (int i = 1; i < nodes; ++i) jacobi(i, i - 1) = jacobi(i - 1, i) = i / std::sqrt(4.0 * i * i - 1);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(jacobi);
  return {(eigen.eigenvalues().array() + 1) / 2, eigen.eigenvectors().row(0).array().square()};
}

}  // namespace emmetrope
