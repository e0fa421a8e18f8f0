#include "pipeline/eye/uncertainty/uncertain_eye.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <map>
#include <numeric>

#include "meshing/biometry.hpp"
#include "meshing/optics.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/instruments/instruments.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "tests/support/random_eye.hpp"

namespace emmetrope {
namespace {

using namespace meshing;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double value_of(const Json& json) { return json.get<Measured>().value; }
double sigma_of(const Json& json) { return json.get<Measured>().sigma(); }

/// Eyes drawn from an estimate's distribution.
std::vector<ParametricEye> draw(const UncertainEye& estimate, int count, unsigned seed) {
  const ParametricEye& mean = estimate.eye();
  const MatrixXd root = mean.covariance.llt().matrixL();
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<ParametricEye> eyes;
  for (int k = 0; k < count; ++k) {
    const VectorXd shift = root * VectorXd::NullaryExpr(root.rows(), [&]() { return normal(random); });
    ParametricEye eye = mean;
    for (std::size_t i = 0; i < eye.parameter_names.size(); ++i)
      eye.set(eye.parameter_names[i], mean.get(eye.parameter_names[i]) + shift[static_cast<Eigen::Index>(i)]);
    eyes.push_back(std::move(eye));
  }
  return eyes;
}

TEST(UncertainEye, IntervalsAgreeWithMonteCarlo) {
  ParametricEye toric = random_eye(21);
  toric.cornea_j0_per_mm = 0.004;  // away from zero, where flat and steep are smooth
  const UncertainEye estimate = fitted_eye(toric);
  const Json linear = biometry_json(estimate, {});
  std::map<std::string, std::vector<double>> drawn;
  constexpr int count = 600;
  for (const ParametricEye& eye : draw(estimate, count, 1)) {
    const CornealDepth cornea = anterior_cornea(eye);
    const CornealPower power = corneal_power(cornea);
    drawn["axial_length_mm"].push_back(eye.pole_depth_mm());
    drawn["anterior_chamber_depth_mm"].push_back(lens_on_axis(eye).front_mm);
    drawn["flat"].push_back(power.M_D - std::hypot(power.J0_D, power.J45_D));
    drawn["cylinder"].push_back(2 * std::hypot(power.J0_D, power.J45_D));
    drawn["J0"].push_back(power.J0_D);
    drawn["axis"].push_back(
        normalise_axis_deg(std::atan2(power.J45_D, power.J0_D) / degree / 2));  // about 90
    drawn["section"].push_back(section_width_mm(cornea, 2.3, 0));
    drawn["zernike"].push_back(corneal_zernike_um(cornea, 6, 6)[12]);
  }
  const auto spread = [&](const std::string& name) {
    const std::vector<double>& v = drawn.at(name);
    const double mean = std::accumulate(v.begin(), v.end(), 0.0) / v.size();
    double sum = 0;
    for (const double x : v) sum += (x - mean) * (x - mean);
    return std::sqrt(sum / (v.size() - 1));
  };
  // A standard deviation from 600 draws is itself known to 3 %; 10 % is 3.5 sigma.
  const auto agree = [&](const std::string& name, const Json& json) {
    EXPECT_NEAR(sigma_of(json) / spread(name), 1, 0.1) << name;
  };
  agree("axial_length_mm", linear["axial_length_mm"]);
  agree("anterior_chamber_depth_mm", linear["anterior_chamber_depth_mm"]);
  agree("flat", linear["keratometry"]["flat"]["power_D"]);
  agree("cylinder", linear["keratometry"]["cylinder_D"]);
  agree("axis", linear["keratometry"]["flat"]["axis_deg"]);
  agree("J0", linear["astigmatism"]["J0_D"]);
  agree("section", linear["astigmatism"]["section_2p3mm"]["horizontal_mm"]);
  agree("zernike", linear["cornea_zernike_um"][12]);
}

/// A biconic has no coma, a healthy cornea has: what the fit leaves out is in the interval.
TEST(UncertainEye, TermsThatABiconicLacksHaveAHealthyCorneasSpread) {
  const Json terms = biometry_json(fitted_eye(random_eye(22)), {})["cornea_zernike_um"];
  double variance = 0;
  for (std::size_t j = 6; j < terms.size(); ++j) {
    if (j == 12) continue;  // spherical aberration is the conicoid's
    EXPECT_GT(sigma_of(terms[j]), 0.05) << j;
    if (j < 10) {
      EXPECT_EQ(terms[j]["source"], "prior") << j;
    }
    variance += std::pow(sigma_of(terms[j]), 2);
  }
  EXPECT_NEAR(std::sqrt(variance), 1.0, 0.1);  // um rms, Wang et al. 2003
}

TEST(UncertainEye, GlobeExtentsOfAnEllipsoidAreItsAxes) {
  ParametricEye eye = random_eye(22);
  std::fill(eye.displacement_mm.begin(), eye.displacement_mm.end(), 0);
  const Json json = biometry_json(fitted_eye(eye), {});
  EXPECT_NEAR(value_of(json["globe_width_mm"]), 2 * eye.globe_semi_axes_mm.x(), 1e-6);
  EXPECT_NEAR(value_of(json["globe_height_mm"]), 2 * eye.globe_semi_axes_mm.y(), 1e-6);
  EXPECT_NEAR(value_of(json["optical_axial_length_mm"]), eye.axial_length_mm + 0.2, 1e-12);
}

TEST(UncertainEye, UpdateOfOneNumberIsTheTextbookOne) {
  ParametricEye eye = random_eye(23);
  eye.lens_decentre_mm = eye.lens_tilt_deg = {0, 0};  // the chamber's depth is then one parameter
  UncertainEye estimate = fitted_eye(eye);
  const auto index = [&](const char* name) {
    const auto& names = estimate.eye().parameter_names;
    return std::find(names.begin(), names.end(), name) - names.begin();
  };
  const auto acd = index("anterior_chamber_depth_mm");
  const double before = estimate.eye().covariance(acd, acd), sigma = 0.02;
  const double measured = eye.anterior_chamber_depth_mm + 0.03;
  const double innovation = estimate.learn(anterior_chamber_measurement(std::to_string(measured), sigma));
  EXPECT_NEAR(innovation, 0.03 / std::sqrt(before + sigma * sigma), 1e-4);
  const double gain = before / (before + sigma * sigma);
  EXPECT_NEAR(estimate.eye().anterior_chamber_depth_mm, eye.anterior_chamber_depth_mm + gain * 0.03, 1e-6);
  EXPECT_NEAR(estimate.eye().covariance(acd, acd), (1 - gain) * before, 1e-12);
}

/// A prior that is doubted is no image that contradicts; what is learnt stays the textbook's.
TEST(UncertainEye, WhatAPriorAloneTellsMayBeTwiceAsFar) {
  ParametricEye eye = random_eye(23);
  eye.lens_decentre_mm = eye.lens_tilt_deg = {0, 0};
  const auto& names = eye.parameter_names;
  const auto acd = std::find(names.begin(), names.end(), "anterior_chamber_depth_mm") - names.begin();
  const double before = eye.covariance(acd, acd), sigma = 0.02, depth_mm = eye.anterior_chamber_depth_mm;
  eye.source["anterior_chamber_depth_mm"] = "prior";
  UncertainEye estimate = fitted_eye(eye);
  const double innovation =
      estimate.learn(anterior_chamber_measurement(std::to_string(depth_mm + 0.03), sigma));
  EXPECT_NEAR(innovation, 0.03 / std::sqrt(4 * before + sigma * sigma), 1e-4);
  const double gain = before / (before + sigma * sigma);
  EXPECT_NEAR(estimate.eye().anterior_chamber_depth_mm, depth_mm + gain * 0.03, 1e-6);
}

/// 5 D of oblique cylinder, as after a graft, where a T1 study has told next to nothing of astigmatism.
TEST(UncertainEye, AHighAstigmatismIsBelievedWhereImagesAreSilent) {
  ParametricEye eye = random_eye(24);
  const auto& names = eye.parameter_names;
  eye.cornea_j0_per_mm = eye.cornea_j45_per_mm = 0;
  for (const auto& [name, sigma_D] : {std::pair{"cornea_j0_per_mm", 0.56}, {"cornea_j45_per_mm", 0.39}}) {
    const auto at = std::find(names.begin(), names.end(), name) - names.begin();
    eye.covariance.row(at).setZero();
    eye.covariance.col(at).setZero();
    eye.covariance(at, at) = std::pow(sigma_D / 337.5, 2);
  }
  const double mean_D = corneal_power(anterior_cornea(eye)).M_D;
  const auto measured =
      keratometry_measurement(fmt::format("{}@45/{}@135", mean_D - 2.5, mean_D + 2.5), 0.25);
  EXPECT_GT(fitted_eye(eye).learn(measured), 5);  // images that saw no astigmatism
  for (const char* name : {"cornea_j0_per_mm", "cornea_j45_per_mm"}) eye.source[name] = "prior";
  EXPECT_LT(fitted_eye(eye).learn(measured), 4);
}

TEST(UncertainEye, KeratometryTakesOverTheCorneaAndItsCorrelations) {
  const ParametricEye eye = random_eye(24);
  UncertainEye estimate = fitted_eye(eye);
  const Json before = biometry_json(estimate, {});
  EXPECT_EQ(before["astigmatism"]["M_D"]["source"], "mri");
  const CornealPower mri = corneal_power(anterior_cornea(eye));
  const double flat = mri.M_D - 0.4, steep = mri.M_D + 0.8;
  estimate.learn(keratometry_measurement(fmt::format("{}@20/{}@110", flat, steep), 0.01));
  const Json after = biometry_json(estimate, {});
  // A sigma far below the image's: the instrument's numbers come back, with its interval and its name.
  EXPECT_NEAR(value_of(after["keratometry"]["flat"]["power_D"]), flat, 0.02);
  EXPECT_NEAR(value_of(after["keratometry"]["steep"]["power_D"]), steep, 0.02);
  EXPECT_NEAR(value_of(after["keratometry"]["flat"]["axis_deg"]), 20, 1);
  EXPECT_NEAR(sigma_of(after["astigmatism"]["M_D"]), 0.01 / std::sqrt(2), 0.001);
  EXPECT_EQ(after["astigmatism"]["M_D"]["source"], "keratometry");
  EXPECT_EQ(after["anterior_chamber_depth_mm"]["source"], "mri");
  // Length and curvature were correlated by 0.4: what is learnt of one moves and tightens the other.
  EXPECT_LT(sigma_of(after["axial_length_mm"]), sigma_of(before["axial_length_mm"]));
}

/// The part of the information is that of the variances, for a sum of parameters as for one of them.
TEST(UncertainEye, TheImagesShareIsThatOfTheInformation) {
  ParametricEye eye = random_eye(27);
  const auto& names = eye.parameter_names;
  const auto acd = std::find(names.begin(), names.end(), "anterior_chamber_depth_mm") - names.begin();
  const auto lens = std::find(names.begin(), names.end(), "lens_thickness_mm") - names.begin();
  eye.prior_sigma["anterior_chamber_depth_mm"] = 0.3;
  eye.prior_sigma["lens_thickness_mm"] = 0.4;
  const auto origin_with = [&](double acd_sigma, double lens_sigma) {
    for (const auto& [at, sigma] : {std::pair{acd, acd_sigma}, {lens, lens_sigma}}) {
      eye.covariance.row(at).setZero();
      eye.covariance.col(at).setZero();
      eye.covariance(at, at) = sigma * sigma;
    }
    const UncertainEye estimate = fitted_eye(eye);
    return estimate
        .propagate([](const ParametricEye& e) {
          return VectorXd::Constant(1, e.anterior_chamber_depth_mm + e.lens_thickness_mm);
        })
        .origin[0];
  };
  const Origin seen = origin_with(0.06, 0.08);
  EXPECT_EQ(seen.source, "mri");
  EXPECT_NEAR(*seen.image_share, 0.96, 1e-6);
  const Origin half = origin_with(0.24, 0.32);
  EXPECT_EQ(half.source, "mri+prior");
  EXPECT_NEAR(*half.image_share, 0.36, 1e-6);
  const Origin hardly = origin_with(0.297, 0.396);
  EXPECT_EQ(hardly.source, "prior");
  EXPECT_NEAR(*hardly.image_share, 0.0199, 1e-6);
  // What is wholly the images' (a place in the scanner has no population).
  const Propagated apex = fitted_eye(eye).propagate(
      [](const ParametricEye& e) { return VectorXd::Constant(1, e.get("apex_x_mm")); });
  EXPECT_EQ(apex.origin[0].source, "mri");
  EXPECT_EQ(*apex.origin[0].image_share, 1);
  EXPECT_TRUE(std::isinf(apex.prior_sigma[0]));
}

TEST(UncertainEye, AxialLengthReadsToThePhotoreceptors) {
  const ParametricEye eye = random_eye(25);
  UncertainEye estimate = fitted_eye(eye);
  const double optical = eye.pole_depth_mm() + 0.2 + 0.05;
  estimate.learn(axial_length_measurement(std::to_string(optical), 0.001, 0.2));
  const Json json = biometry_json(estimate, {});
  EXPECT_NEAR(value_of(json["optical_axial_length_mm"]), optical, 1e-4);
  EXPECT_NEAR(value_of(json["axial_length_mm"]), optical - 0.2, 1e-4);
  EXPECT_EQ(json["axial_length_mm"]["source"], "biometry");
}

TEST(UncertainEye, WhatTheFitLeftOutEntersAsALabelledPrior) {
  const UncertainEye estimate = fitted_eye(random_eye(26));
  const Json json = biometry_json(estimate, {});
  EXPECT_EQ(json["corneal_thickness_mm"]["source"], "prior");
  EXPECT_NEAR(sigma_of(json["corneal_thickness_mm"]), 0.035, 1e-6);
  ParametricEye incomplete = random_eye(26);
  incomplete.parameter_names[5] = "lens_tilt_x_deg";  // was cornea_c_per_mm
  EXPECT_THROW(fitted_eye(incomplete), Error);
  ParametricEye impossible = random_eye(26);
  impossible.covariance(5, 12) = impossible.covariance(12, 5) = 1;
  EXPECT_THROW(fitted_eye(impossible), Error);
}

TEST(UncertainEye, CylinderThatDrownsHasAnUnknownAxis) {
  ParametricEye eye = random_eye(27);
  eye.cornea_j0_per_mm = eye.cornea_j45_per_mm = 0;
  const Json k = biometry_json(fitted_eye(eye), {})["keratometry"];
  EXPECT_DOUBLE_EQ(k["cylinder_D"]["ci95"][0], 0);
  EXPECT_NEAR(k["flat"]["axis_deg"]["ci95"][1].get<double>() - k["flat"]["axis_deg"]["ci95"][0].get<double>(),
              180, 1e-9);
}

TEST(UncertainEye, ScalePriorStretchesEveryLengthTogether) {
  UncertainEye estimate = fitted_eye(random_eye(30));
  const Json before = biometry_json(estimate, {});
  estimate.add_scale_prior(0.003);
  const Json after = biometry_json(estimate, {});
  for (const char* key : {"axial_length_mm", "globe_width_mm", "lens_anterior_radius_mm"}) {
    const auto was = before[key].get<Measured>(), is = after[key].get<Measured>();
    EXPECT_NEAR(is.sigma(), std::hypot(was.sigma(), 0.003 * was.value), 1e-4) << key;
  }
  // A length measured elsewhere settles the scale, and with it the globe's width.
  const double optical = value_of(after["optical_axial_length_mm"]);
  estimate.learn(axial_length_measurement(std::to_string(optical), 0.001, 0.2));
  EXPECT_LT(sigma_of(biometry_json(estimate, {})["globe_width_mm"]), sigma_of(after["globe_width_mm"]));
}

TEST(Instruments, FlagsAreReadOrRefused) {
  InstrumentFlags flags;
  flags.axial_length = {"os:23.60+-0.02", "od:23.4"};
  flags.topography = {"os:maps/left+-eye.csv+-0.1"};
  const auto by_eye = parse_instruments(flags, 0.2);
  const auto& os = by_eye.at(Laterality::os);
  EXPECT_DOUBLE_EQ(os.measurements.at(0).value[0], 23.6);
  EXPECT_DOUBLE_EQ(os.measurements[0].covariance(0, 0), 0.02 * 0.02);
  EXPECT_EQ(os.topography->file, "maps/left+-eye.csv");
  EXPECT_DOUBLE_EQ(os.topography->sigma_D, 0.1);
  EXPECT_DOUBLE_EQ(by_eye.at(Laterality::od).measurements.at(0).covariance(0, 0), 0.05 * 0.05);
  for (const char* text : {"23.6", "ou:23.6", "od:", "od:23.6+-", "od:23.6+-x", "od:23.6+--1", "od:23.6+-50",
                           "od:x", "od:236", "od:23.6mm"}) {
    InstrumentFlags wrong;
    wrong.axial_length = {text};
    EXPECT_THROW(parse_instruments(wrong, 0.2), Error) << text;
  }
  // Better than any instrument: to be believed, the images would have to be as exact.
  InstrumentFlags exact;
  exact.axial_length = {"od:23.6+-0.005"};
  exact.keratometry = {"od:43.25@175/44.75@85+-0.01"};
  EXPECT_NO_THROW(parse_instruments(exact, 0.2));
  exact.axial_length = {"od:23.6+-0.0049"};
  try {
    parse_instruments(exact, 0.2);
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::usage);
    EXPECT_NE(error.remedy().find("0.005 to 1"), std::string::npos) << error.remedy();
  }
  exact.axial_length = {};
  exact.keratometry = {"od:43.25@175/44.75@85+-0.0099"};
  EXPECT_THROW(parse_instruments(exact, 0.2), Error);
  for (const char* value : {"43.25", "43.25@175", "43.25/44.75", "43.25@175/44.75@100", "7.8@175/7.6@85"})
    EXPECT_THROW(keratometry_measurement(value, 0.25), Error) << value;
  const ExternalMeasurement k = keratometry_measurement("44.75@85/43.25@175", 0.25);
  EXPECT_NEAR(k.value[0], 44, 1e-12);
  EXPECT_NEAR(k.value[1], 0.75 * std::cos(350 * degree), 1e-12);
  EXPECT_NEAR(k.value[2], 0.75 * std::sin(350 * degree), 1e-12);
  // Meridians that are not quite square tell of the axis both: 177.5 here.
  for (const char* askew : {"43@175/46@90", "43@180/46@85", "46@85/43@0", "43@0/46@85"}) {
    const ExternalMeasurement both = keratometry_measurement(askew, 0.25);
    EXPECT_NEAR(both.value[1], 1.5 * std::cos(355 * degree), 1e-12) << askew;
    EXPECT_NEAR(both.value[2], 1.5 * std::sin(355 * degree), 1e-12) << askew;
  }
}

TEST(Plausibility, FlagsWhatNoEyeHas) {
  ParametricEye eye = random_eye(28);
  eye.cornea_c_per_mm = 1 / 9.9;
  Json biometry = biometry_json(fitted_eye(eye), {});
  std::vector<std::string> failed;
  for (const PlausibilityFlag& flag : plausibility(biometry)) {
    if (!flag.passed()) failed.push_back(flag.name);
  }
  EXPECT_EQ(failed, (std::vector<std::string>{"keratometry_flat_D", "keratometry_steep_D"}));
}

/// Without error the root itself; along the mean alone a normal number; about zero the chi distribution; all
/// to what 4000 draws are worth, 0.05 of a standard deviation.
TEST(RootSumSquare, IsThatOfTheDistributionsThatAreKnown) {
  const Eigen::Vector3d mean(2, -6, 9);  // 11 long
  const auto of = [](const Eigen::Vector3d& value, const MatrixXd& covariance) {
    return root_sum_square({value, covariance, {"prior", "prior", "mri"}});
  };
  const Measured exact = of(mean, MatrixXd::Zero(3, 3));
  EXPECT_NEAR(exact.value, 11, 1e-12);
  EXPECT_NEAR(exact.ci95[1], 11, 1e-12);

  const Measured along = of(mean, 4 * mean * mean.transpose() / 121);
  EXPECT_NEAR(along.value, 11, 0.1);
  EXPECT_NEAR(along.ci95[0], 11 - 1.96 * 2, 0.25);
  EXPECT_NEAR(along.ci95[1], 11 + 1.96 * 2, 0.25);
  EXPECT_EQ(along.source, "mri");

  const Measured about_zero = of(Eigen::Vector3d::Zero(), 4 * MatrixXd::Identity(3, 3));
  const boost::math::chi_squared chi2(3);
  EXPECT_NEAR(about_zero.value, 2 * std::sqrt(boost::math::quantile(chi2, 0.5)), 0.1);
  EXPECT_NEAR(about_zero.ci95[0], 2 * std::sqrt(boost::math::quantile(chi2, 0.025)), 0.1);
  EXPECT_NEAR(about_zero.ci95[1], 2 * std::sqrt(boost::math::quantile(chi2, 0.975)), 0.25);
}

TEST(Optics, EyeAndCovarianceAgree) {
  const UncertainEye estimate = fitted_eye(random_eye(29));
  const Json json = optics_json(estimate, {});
  const std::size_t n = json["parameters"].size();
  ASSERT_EQ(json["values"].size(), n);
  ASSERT_EQ(json["sources"].size(), n);
  MatrixXd covariance(n, n);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) covariance(i, j) = json["covariance"][i][j];
  EXPECT_EQ(Eigen::LLT<MatrixXd>(covariance).info(), Eigen::Success);
  EXPECT_EQ(json["parameters"].back(), "lens_index");
  EXPECT_NEAR(std::sqrt(covariance(n - 1, n - 1)), 0.005, 1e-12);

  const EyeModel eye = eye_from_json(json["eye"], ".");
  EXPECT_NEAR(eye.axial_length_mm(), estimate.eye().pole_depth_mm() + 0.2, 1e-9);
  EXPECT_EQ(eye.surfaces.size(), 6U);
  const Eigen::Matrix2d curvature = eye.surface("cornea_anterior").shape->vertex_curvature();
  EXPECT_LT((curvature - estimate.eye().cornea_curvature_per_mm()).norm(), 1e-9);
  EXPECT_NEAR(*eye.surface("cornea_posterior").shape->depth_mm(2, 1) + estimate.eye().cornea_thickness_mm,
              estimate.eye().cornea_posterior_depth_mm(2, 1), 1e-12);
}

}  // namespace
}  // namespace emmetrope
