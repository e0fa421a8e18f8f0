#pragma once
#include <Eigen/Core>

namespace emmetrope {

/// Zernike polynomials in OSA/ANSI Z80.28 order and normalisation (rms 1 over the unit circle):
/// j = (n (n + 2) + m) / 2, Z = N R_n^|m|(rho) cos(m theta) for m >= 0, sin(|m| theta) for m < 0, theta from
/// +x.
struct ZernikeIndex {
  int n = 0;  ///< radial order
  int m = 0;  ///< azimuthal frequency
};
ZernikeIndex zernike_index(int j);
/// Number of terms up to and including radial order n: (n + 1)(n + 2) / 2.
constexpr int zernike_count(int order) { return (order + 1) * (order + 2) / 2; }

/// Values of all terms up to `order` at (x, y) in units of the normalisation radius.
Eigen::VectorXd zernike_values(int order, double x, double y);

/// One term with its gradient.
struct ZernikeJet {
  double value = 0;
  Eigen::Vector2d gradient{0, 0};
};
ZernikeJet zernike_jet(int j, double x, double y);

/// Coefficients of the same function about axes turned by `angle_rad`.
/// \pre whole orders
Eigen::VectorXd turned_zernike(const Eigen::VectorXd& coefficients, double angle_rad);

}  // namespace emmetrope
