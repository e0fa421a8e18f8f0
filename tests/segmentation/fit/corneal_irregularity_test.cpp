#include "segmentation/fit/corneal_irregularity.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double noise = 0.03;

/// Voxels of a sagittal and a coronal stack about the cornea of an eye at the origin that looks ahead.
class ScoreTest : public testing::Test {
 protected:
  ScoreTest() {
    layout_.stacks = 1;
    parameters_ = population_mean(layout_);
    for (const auto& [tissue, intensity] : {std::pair{vitreous, 1.0},
                                            {aqueous, 0.95},
                                            {wall, 0.3},
                                            {cornea, 0.25},
                                            {lens, 0.35},
                                            {iris, 0.2},
                                            {lid, 0.5},
                                            {air, 0.02},
                                            {surround, 0.6}})
      parameters_[tissue] = intensity;
    problem_.model = &model_;
    problem_.limbus_sigma_mm = 0;
    problem_.loss_scale = 1e6;  // squares: then the statistic's distribution is known
    problem_.priors.mean = parameters_;
    problem_.priors.sigma = VectorXd::Constant(layout_.size(), 1e3);
    for (double x = -4; x <= 4; x += 0.4)
      for (double z = -4; z <= 4; z += 0.4)
        for (double depth = -0.8; depth <= 2; depth += 0.4) {
          Sample sample;
          sample.position = Vector3d(x, depth, z);  // ahead is -y
          sample.deviation = static_cast<float>(noise);
          sample.zone = Zone::front;
          sample.near_cornea = true;
          problem_.samples.push_back(sample);
        }
  }

  /// The statistic on noisy images of a cornea with this free form (um).
  double chi2_of(const VectorXd& form_um, unsigned seed) {
    const ForwardModel true_model = model_.with_irregular_cornea();
    VectorXd truth = with_free_form(parameters_, true_model.layout());
    truth.segment(true_model.layout().corneal_form(), form_um.size()) = form_um;
    const ForwardModel::AtParameters at(true_model, truth);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (Sample& sample : problem_.samples)
      sample.value = static_cast<float>(at.intensity(sample, nullptr) + noise * normal(random));
    return corneal_irregularity(problem_, parameters_, active_).chi2;
  }

  ParameterLayout layout_;
  ForwardModel model_{layout_,
                      {{Vector3d::UnitX(), -Vector3d::UnitZ(), Vector3d::UnitY(), 1.6, 1.6, 1, 2, noise}},
                      Vector3d::Zero()};
  VectorXd parameters_;
  std::vector<int> active_{apex_x,    apex_y,     apex_z,   gaze_horizontal,  gaze_vertical, cornea_c,
                           cornea_j0, cornea_j45, cornea_q, cornea_thickness, lid_thickness, cornea,
                           aqueous,   lid,        air};
  FitProblem problem_;
};

/// On a regular cornea it is chi2 distributed: mean and variance of 60 images within four standard errors.
TEST_F(ScoreTest, FollowsItsDistributionOnARegularCornea) {
  constexpr int images = 60;
  double mean = 0, square = 0;
  for (unsigned seed = 0; seed < images; ++seed) {
    const double chi2 = chi2_of(VectorXd::Zero(CornealIrregularity::tested_terms), seed);
    mean += chi2 / images;
    square += chi2 * chi2 / images;
  }
  const double variance = 2 * CornealIrregularity::tested_terms;
  EXPECT_NEAR(mean, CornealIrregularity::tested_terms, 4 * std::sqrt(variance / images));
  // The variance of a chi2 sample's variance: (kurtosis - 1) / n of its square, kurtosis 3 + 12 / dof.
  EXPECT_NEAR(square - mean * mean, variance,
              4 * variance * std::sqrt((2 + 12.0 / CornealIrregularity::tested_terms) / images));
}

TEST_F(ScoreTest, FindsComa) {
  VectorXd coma = VectorXd::Zero(CornealIrregularity::tested_terms);
  coma[1] = 12;
  EXPECT_GT(chi2_of(coma, 1), CornealIrregularity::chi2_limit);
}

/// What the other parameters describe does not count: an eye that stands elsewhere is no irregular one.
TEST_F(ScoreTest, IsBlindToWhatTheOtherParametersDescribe) {
  const double before = chi2_of(VectorXd::Zero(CornealIrregularity::tested_terms), 5);
  parameters_[apex_y] += 0.01;  // the images stay
  parameters_[cornea_c] += 0.0005;
  parameters_[gaze_horizontal] += 0.1;
  EXPECT_NEAR(corneal_irregularity(problem_, parameters_, active_).chi2, before, 3);
}

}  // namespace
}  // namespace emmetrope::segmentation
