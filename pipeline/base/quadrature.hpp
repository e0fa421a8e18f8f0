#pragma once
#include <Eigen/Core>

namespace emmetrope {

/// Nodes on [0, 1] and weights of Gauss-Legendre quadrature (Golub and Welsch 1969).
struct Quadrature {
  Eigen::VectorXd node, weight;
};
Quadrature gauss_legendre(int nodes);

}  // namespace emmetrope
