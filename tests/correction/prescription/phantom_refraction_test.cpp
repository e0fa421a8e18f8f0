#include "tests/support/phantom_refraction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pipeline/eye/optics/paraxial.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

namespace emmetrope::correction {
namespace {

/// An eye as people have them, and what a fit would find of it whose covariance is true.
PhantomEye drawn_eye(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  ParametricEye truth;
  const auto vary = [&](const char* name, double sigma) {
    truth.set(name, truth.get(name) + sigma * normal(random));
  };
  vary("cornea_c_per_mm", 0.004);
  vary("cornea_j0_per_mm", 0.002);
  vary("cornea_j45_per_mm", 0.001);
  vary("axial_length_mm", 0.8);
  vary("lens_anterior_radius_mm", 0.8);

  PhantomEye eye;
  const double lens_index = 1.4225 + 0.005 * normal(random);
  OpticalDefaults defaults;
  defaults.lens_index = lens_index;
  eye.truth = analytic_eye(truth, nullptr, defaults);
  const CornealPower power = corneal_power(anterior_cornea(truth));
  eye.corneal_power_D = {power.M_D, power.J0_D, power.J45_D};
  eye.seed = seed;

  struct Spread {
    const char* name;
    double sigma;
  };
  std::vector<Spread> spreads{{"cornea_c_per_mm", 0.0012},         {"cornea_j0_per_mm", 0.0006},
                              {"cornea_j45_per_mm", 0.0006},       {"axial_length_mm", 0.04},
                              {"anterior_chamber_depth_mm", 0.03}, {"lens_thickness_mm", 0.03}};
  for (const char* known_by_a_prior :
       {"cornea_q", "cornea_q_split", "cornea_thickness_mm", "cornea_back_ratio", "lens_anterior_radius_mm",
        "lens_posterior_radius_mm", "lens_anterior_q", "lens_posterior_q", "lens_decentre_x_mm",
        "lens_decentre_y_mm", "lens_tilt_x_deg", "lens_tilt_y_deg"})
    spreads.push_back({known_by_a_prior, population_value(known_by_a_prior).sigma / 3});
  const auto n = static_cast<Eigen::Index>(spreads.size());
  eye.fitted = truth;
  eye.fitted.covariance = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& [name, sigma] = spreads[i];
    eye.fitted.set(name, truth.get(name) + sigma * normal(random));
    eye.fitted.covariance(i, i) = sigma * sigma;
    eye.fitted.parameter_names.emplace_back(name);
    eye.fitted.source[name] = "mri";
  }
  return eye;
}

TEST(PhantomRefraction, ErrorsAreAsLargeAsStated) {
  constexpr int eyes = 16;
  for (const Knowledge& knowledge :
       {Knowledge{false, true}, Knowledge{true, true}, Knowledge{false, false}}) {
    double chi2 = 0;
    for (int i = 0; i < eyes; ++i) {
      const RefractionError error = refraction_error(drawn_eye(i), knowledge);
      chi2 += error.spot.dot(error.covariance.inverse() * error.spot);
    }
    // Of 3 eyes degrees of freedom: within three standard deviations.
    EXPECT_NEAR(chi2 / (3 * eyes), 1, 3 * std::sqrt(2.0 / (3 * eyes)))
        << "keratometry " << knowledge.keratometry << ", index " << knowledge.lens_index;
  }
}

TEST(PhantomRefraction, AnUnknownLensIndexMovesTheSphereOnly) {
  const PhantomEye eye = drawn_eye(3);
  const RefractionError given = refraction_error(eye, {false, true}),
                        unknown = refraction_error(eye, {false, false});
  const auto paraxial_M_D = [&](double lens_index) {
    EyeModel truth = eye.truth;
    truth.media.at("lens").index = lens_index;
    return move_towards_eye(paraxial_refraction(truth, 589.3), -12).M_D;
  };
  const double of_the_index_D = (paraxial_M_D(1.4175) - paraxial_M_D(1.4275)) / 2;
  EXPECT_NEAR(std::sqrt(unknown.covariance(0, 0) - given.covariance(0, 0)), of_the_index_D,
              0.05 * of_the_index_D);
  EXPECT_LT((unknown.spot - given.spot).tail<2>().norm(), 0.05);
  EXPECT_NEAR(unknown.covariance(1, 1), given.covariance(1, 1), 0.1 * given.covariance(1, 1));
}

}  // namespace
}  // namespace emmetrope::correction
