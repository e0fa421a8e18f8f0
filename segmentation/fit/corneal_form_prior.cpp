#include "segmentation/fit/corneal_form_prior.hpp"

#include <array>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/parametric/corneal_form.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Sources are given in docs/method/segmentation.md, "Priors".
constexpr double bump_height_um = 75;  ///< rms
constexpr std::array<double, 6> bump_widths_mm{1.1, 1.3, 1.5, 1.7, 1.9, 2.1};
constexpr std::array<double, 6> bump_distances_mm{0.1, 0.4, 0.8, 1.2, 1.6, 2.0};
constexpr std::array<double, 5> otherwise_um{3, 2, 1, 0.5, 0.25};  ///< from the third order on

/// Zernike terms of a bump of height 1 on the x axis.
VectorXd terms_of_bump(double distance_mm, double width_mm) {
  constexpr int rings = 100, spokes = 32;
  VectorXd terms = VectorXd::Zero(zernike_count(corneal_form_order));
  for (int i = 0; i < rings; ++i)
    for (int k = 0; k < spokes; ++k) {
      const double rho = std::sqrt((i + 0.5) / rings), angle = 2 * pi * k / spokes;  // rings of equal area
      const double x = rho * std::cos(angle), y = rho * std::sin(angle);
      const double away_mm = std::hypot(corneal_form_radius_mm * x - distance_mm, corneal_form_radius_mm * y);
      terms += std::exp(-away_mm * away_mm / (2 * width_mm * width_mm)) / (rings * spokes) *
               zernike_values(corneal_form_order, x, y);
    }
  return terms;
}

}  // namespace

MatrixXd corneal_form_covariance_um2() {
  MatrixXd covariance = MatrixXd::Zero(corneal_form_terms, corneal_form_terms);
  for (int i = 0; i < corneal_form_terms; ++i) {
    const double sigma_um = otherwise_um[zernike_index(corneal_form_first + i).n - 3];
    covariance(i, i) = sigma_um * sigma_um;
  }
  constexpr double share = 1.0 / (bump_widths_mm.size() * bump_distances_mm.size());
  for (const double width_mm : bump_widths_mm)
    for (const double distance_mm : bump_distances_mm) {
      const VectorXd terms = bump_height_um * terms_of_bump(distance_mm, width_mm);
      // In any direction: cosine and sine of an angle are alike and unrelated.
      for (int i = 0; i < corneal_form_terms; ++i)
        for (int k = 0; k < corneal_form_terms; ++k) {
          const auto [n, m] = zernike_index(corneal_form_first + i);
          const auto [other_n, other_m] = zernike_index(corneal_form_first + k);
          if (m != other_m) continue;
          const double product =
              terms[(n * (n + 2) + std::abs(m)) / 2] * terms[(other_n * (other_n + 2) + std::abs(m)) / 2];
          covariance(i, k) += share * (m == 0 ? 1 : 0.5) * product;
        }
    }
  return covariance;
}

}  // namespace emmetrope::segmentation
