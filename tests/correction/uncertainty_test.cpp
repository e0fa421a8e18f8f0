#include "correction/uncertainty.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "raytrace/eye/paraxial.hpp"

namespace emmetrope::correction {
namespace {

/// A measured eye as the mesh stage describes it, with an oblique cornea and a tilted lens.
Json optics() {
  const double c = 1 / 7.8, cylinder = 0.006;
  const double j0 = cylinder * std::cos(0.7), j45 = cylinder * std::sin(0.7), ratio = 0.83;
  const double axis_deg = 0.35 * 180 / 3.14159265358979;
  const auto cornea = [&](const char* name, double position_mm, double scale, const char* medium) {
    return Json{{"name", name},
                {"type", "biconic"},
                {"position_mm", position_mm},
                {"radius_mm", {1 / (scale * (c + cylinder)), 1 / (scale * (c - cylinder))}},
                {"q", {-0.2, -0.2}},
                {"axis_deg", axis_deg},
                {"medium_after", medium}};
  };
  Json eye;
  eye["name"] = "measured";
  eye["reference_wavelength_nm"] = 589.3;
  eye["media"] = {{"cornea", {{"index", 1.376}}},
                  {"aqueous", {{"index", 1.336}}},
                  {"lens", {{"index", 1.4254}}},
                  {"vitreous", {{"index", 1.336}}}};
  eye["surfaces"] = {cornea("cornea_anterior", 0, 1, "cornea"),
                     cornea("cornea_posterior", 0.55, 1 / ratio, "aqueous"),
                     {{"name", "iris"}, {"type", "stop"}, {"position_mm", 3.4}, {"diameter_mm", 3.0}},
                     {{"name", "lens_anterior"},
                      {"type", "conic"},
                      {"position_mm", 3.4},
                      {"radius_mm", 10.5},
                      {"q", -3},
                      {"medium_after", "lens"}},
                     {{"name", "lens_posterior"},
                      {"type", "conic"},
                      {"position_mm", 7.2},
                      {"radius_mm", -6.0},
                      {"q", -1},
                      {"medium_after", "vitreous"}},
                     {{"name", "retina"}, {"type", "sphere"}, {"position_mm", 24.0}, {"radius_mm", -12.0}}};
  const std::vector<std::string> names{
      "cornea_c_per_mm",         "cornea_j0_per_mm",         "cornea_j45_per_mm",         "cornea_q",
      "cornea_back_ratio",       "cornea_thickness_mm",      "anterior_chamber_depth_mm", "lens_thickness_mm",
      "lens_anterior_radius_mm", "lens_posterior_radius_mm", "optical_axial_length_mm",   "lens_tilt_x_deg",
      "lens_tilt_y_deg"};
  const std::vector<double> values{c, j0, j45, -0.2, ratio, 0.55, 3.4, 3.8, 10.5, 6.0, 24.0, 0, 0};
  const std::vector<double> sigma{0.0016, 0.0006, 0.0006, 0.1,  0.015, 0.03, 0.02,
                                  0.02,   0.5,    0.3,    0.03, 1.5,   1.5};
  Json covariance = Json::array();
  for (std::size_t i = 0; i < names.size(); ++i) {
    std::vector<double> row(names.size(), 0.0);
    row[i] = sigma[i] * sigma[i];
    // Deeper chamber, thinner lens: as a fit finds them.
    if (i == 6) row[7] = -0.5 * sigma[6] * sigma[7];
    if (i == 7) row[6] = -0.5 * sigma[6] * sigma[7];
    covariance.push_back(row);
  }
  return {{"eye", eye},
          {"parameters", names},
          {"values", values},
          {"covariance", covariance},
          {"sources", std::vector<std::string>(names.size(), "mri")}};
}

PowerVector paraxial(const EyeModel& eye) { return paraxial_refraction(eye, 589.3); }

TEST(UncertainEye, IsTheEyeThatItsParametersDescribe) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  EXPECT_EQ(eye.parameters.back(), "lens_index");
  EXPECT_NEAR(std::sqrt(eye.covariance(13, 13)), 0.005, 1e-12);
  const PowerVector rebuilt = paraxial(eye_at(eye, eye.values)), given = paraxial(eye.eye);
  EXPECT_NEAR(rebuilt.M_D, given.M_D, 1e-9);
  EXPECT_NEAR(rebuilt.J0_D, given.J0_D, 1e-9);
  EXPECT_NEAR(rebuilt.J45_D, given.J45_D, 1e-9);
}

TEST(UncertainEye, TiltTurnsTheLensAboutItsMiddle) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  Eigen::VectorXd values = eye.values;
  values[eye.index_of("lens_tilt_x_deg")] = 5;
  const EyeModel tilted = eye_at(eye, values);
  const Eigen::Vector3d front = tilted.surface("lens_anterior").eye_from_surface().translation();
  const Eigen::Vector3d back = tilted.surface("lens_posterior").eye_from_surface().translation();
  EXPECT_LT(((front + back) / 2 - Eigen::Vector3d(0, 0, -5.3)).norm(), 1e-12);
  EXPECT_NEAR((front - back).norm(), 3.8, 1e-12);
}

TEST(UncertainEye, RefusesWhatDoesNotFit) {
  const auto refused = [](Json json) {
    try {
      uncertain_eye_from_json(json, ".", 0.005);
    } catch (const Error& error) {
      return error.status() == ExitStatus::input_invalid;
    }
    return false;
  };
  Json missing = optics();
  missing.erase("covariance");
  EXPECT_TRUE(refused(missing));
  Json short_row = optics();
  short_row["covariance"][3].erase(0);
  EXPECT_TRUE(refused(short_row));
  Json indefinite = optics();
  indefinite["covariance"][0][1] = indefinite["covariance"][1][0] = 1.0;
  EXPECT_TRUE(refused(indefinite));
  Json other_eye = optics();
  other_eye["values"][10] = 25.0;
  EXPECT_FALSE(refused(other_eye)) << "a retina is placed by its change only";
  other_eye["values"][0] = 1 / 7.5;
  EXPECT_TRUE(refused(other_eye));
}

TEST(Uncertainty, SensitivitiesAreThoseOfTheLiterature) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const auto dM = [&](const char* parameter) { return s(0, eye.index_of(parameter)); };
  // Gullstrand's eye: axial length -2.56 D/mm, chamber +1.18, lens radii +0.37 and +0.73 D/mm. Its lens radii
  // act on the cortex' step of index, 0.050, this lens's on 0.0894.
  constexpr double step = 0.0894 / 0.050;
  EXPECT_NEAR(dM("optical_axial_length_mm"), -2.56, 0.3);
  EXPECT_NEAR(dM("anterior_chamber_depth_mm"), 1.18, 0.4);
  EXPECT_NEAR(dM("lens_anterior_radius_mm"), 0.37 * step, 0.1);
  EXPECT_NEAR(dM("lens_posterior_radius_mm"), 0.73 * step, 0.2);
  EXPECT_NEAR(dM("lens_index"), -155, 20);
  // 376 D per unit of curvature in front, 40 / 0.83 less behind: about -330, at the cornea itself.
  EXPECT_NEAR(dM("cornea_c_per_mm"), -376 + 40 / 0.83, 15);
  EXPECT_NEAR(s(1, eye.index_of("cornea_j0_per_mm")), -376 + 40 / 0.83, 15);
  EXPECT_NEAR(s(2, eye.index_of("cornea_j45_per_mm")), -376 + 40 / 0.83, 15);
  EXPECT_NEAR(s(1, eye.index_of("cornea_j45_per_mm")), 0, 2);
  EXPECT_NEAR(dM("cornea_q"), 0, 1e-6);
}

TEST(Uncertainty, BudgetAddsUpToTheTotal) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  const auto budget = uncertainty_budget(eye, refraction_sensitivity(eye, paraxial));
  double sum = 0;
  for (std::size_t i = 0; i + 1 < budget.size(); ++i) sum += budget[i].M_D * std::abs(budget[i].M_D);
  EXPECT_EQ(budget.back().source, "total");
  EXPECT_NEAR(sum, budget.back().M_D * budget.back().M_D, 1e-9);
  EXPECT_NEAR(budget[6].M_D, 155 * 0.005, 0.1);  // the lens index
  EXPECT_NE(budget[7].M_D, 0);                   // correlations, as there are some
}

TEST(Uncertainty, LinearAgreesWithMonteCarlo) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const Eigen::Matrix3d linear = s * eye.covariance * s.transpose();
  const Eigen::MatrixXd root = eye.covariance.llt().matrixL();
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  constexpr int draws = 4000;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (int i = 0; i < draws; ++i) {
    Eigen::VectorXd unit(eye.values.size());
    for (double& u : unit) u = normal(random);
    const PowerVector p = paraxial(eye_at(eye, eye.values + root * unit));
    const Eigen::Vector3d v(p.M_D, p.J0_D, p.J45_D);
    sum += v;
    squares += v * v.transpose();
  }
  const Eigen::Vector3d mean = sum / draws;
  const Eigen::Matrix3d sampled = squares / draws - mean * mean.transpose();
  // A standard deviation from 4000 draws is good to 1.1 %; four of those, and 2 % of curvature.
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::sqrt(sampled(i, i)) / std::sqrt(linear(i, i)), 1, 0.065) << i;
}

TEST(Uncertainty, MeasurementsBuyWhatTheyMust) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const auto sigma_M = [&](const Eigen::MatrixXd& covariance) {
    return std::sqrt((s * covariance * s.transpose())(0, 0));
  };
  // A known refraction leaves less than its own error, a perfect axial length takes its share out of the
  // budget.
  EXPECT_LT(sigma_M(covariance_after(eye.covariance, known_refraction(s, 0.25))), 0.25);
  const double before = sigma_M(eye.covariance);
  const double axial = std::abs(s(0, eye.index_of("optical_axial_length_mm"))) * 0.03;
  EXPECT_NEAR(sigma_M(covariance_after(eye.covariance, optical_axial_length(eye, 1e-6))),
              std::sqrt(before * before - axial * axial), 1e-6);
  EXPECT_LT(sigma_M(covariance_after(eye.covariance, keratometry(eye, 0.25))), before);
}

TEST(Uncertainty, KeratometryIsTheDerivativeOfItsDefinition) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  const Measurement k = keratometry(eye, 0.25);
  const auto power = [](double c, double q) { return 337.5 / std::sqrt(1 / (c * c) - q * 1.5 * 1.5); };
  const double c = 1 / 7.8, q = -0.2, h = 1e-6;
  EXPECT_NEAR(k.sensitivity(0, eye.index_of("cornea_c_per_mm")),
              (power(c + h, q) - power(c - h, q)) / (2 * h), 1e-4);
  EXPECT_NEAR(k.sensitivity(0, eye.index_of("cornea_q")), (power(c, q + h) - power(c, q - h)) / (2 * h),
              1e-4);
}

TEST(Uncertainty, KalmanMovesTheRefractionToWhatIsKnown) {
  const UncertainEye eye = uncertain_eye_from_json(optics(), ".", 0.005);
  const Eigen::MatrixXd s = refraction_sensitivity(eye, paraxial);
  const Eigen::Vector3d innovation(1.0, 0.2, -0.1);
  const Eigen::VectorXd moved = values_after(eye, known_refraction(s, 1e-4), innovation) - eye.values;
  EXPECT_LT((s * moved - innovation).norm(), 1e-3);
}

TEST(Uncertainty, IntervalsCoverInEveryNotation) {
  Eigen::Matrix3d covariance = Eigen::Vector3d(0.25, 0.01, 0.01).asDiagonal();
  const auto at = refraction_intervals({-3, 0.5, 0}, covariance, "mri", 1);
  EXPECT_NEAR(at.M_D.ci95[0], -3 - 1.96 * 0.5, 1e-3);
  EXPECT_NEAR(at.J0_D.sigma(), 0.1, 1e-9);
  EXPECT_EQ(at.axis_deg.source, "mri");
  // Axis: half the angle of the power vector, sigma_J45 / J / 2 = 5.7 degrees.
  EXPECT_NEAR(at.axis_deg.sigma(), 5.73, 0.35);
  EXPECT_NEAR(at.cylinder_D.sigma(), 0.2, 0.01);
  const auto hardly_any = refraction_intervals({-3, 0.001, 0}, covariance, "mri", 1);
  EXPECT_GT(hardly_any.axis_deg.ci95[1] - hardly_any.axis_deg.ci95[0], 160);
  EXPECT_GE(hardly_any.cylinder_D.ci95[1], hardly_any.cylinder_D.value);
  // The same draws, the same bytes.
  EXPECT_EQ(refraction_intervals({-3, 0.5, 0}, covariance, "mri", 1).sphere_D.ci95, at.sphere_D.ci95);
}

}  // namespace
}  // namespace emmetrope::correction
