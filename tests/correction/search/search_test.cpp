#include <ceres/cost_function.h>
#include <ceres/gradient_checker.h>
#include <gtest/gtest.h>

#include <random>

#include "correction/search/optimise.hpp"
#include "correction/search/retinal_sharpness.hpp"
#include "correction/search/search.hpp"
#include "tests/support/geometric_blur.hpp"
#include "tests/support/nelder_mead.hpp"

/// The search on the geometric model of sharpness: no images, so many eyes in little time.
namespace emmetrope::correction {
namespace {

constexpr double entrance_pupil_mm = 3.3;

Bounds box() { return {Eigen::Vector3d::Constant(-30), Eigen::Vector3d::Constant(30)}; }

double depth_of_focus_D(double blur_arcmin) {
  ImagingLevel level;
  level.pupil_mm = entrance_pupil_mm;
  level.blur_arcmin = blur_arcmin;
  return level.depth_of_focus_D();
}

TEST(Ascent, DepthOfFocusIsWhereTheInverseSquareHasGrownByOne) {
  const auto rays = aberrated_pupil(entrance_pupil_mm, {0, 0, 0}, 0, 24);
  for (const double blur_arcmin : {1.0, 2.0}) {
    const SharpnessFunction sharpness =
        geometric_sharpness(rays, SharpnessCriterion::gradient_energy, blur_arcmin);
    for (const Eigen::Vector3d& unit : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, 1)}) {
      const double value = sharpness(depth_of_focus_D(blur_arcmin) * unit).value;
      // Not 2 to the digit: a disc is no Gaussian.
      EXPECT_NEAR(1 / (value * value), 2, 0.2) << blur_arcmin << ": " << unit.transpose();
    }
  }
}

TEST(Ascent, ConvergesFromEightDioptresAway) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  int evaluations = 0, most = 0;
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d focus(8 * unit(random), 2 * unit(random), 2 * unit(random));
    const auto rays = aberrated_pupil(entrance_pupil_mm, focus, 0.03, 6);
    OptimiserSettings from_afar = coarse_search();
    from_afar.depth_of_focus_D = depth_of_focus_D(8);
    const Optimum coarse = ascend(geometric_sharpness(rays, SharpnessCriterion::gradient_energy, 8),
                                  Eigen::Vector3d::Zero(), box(), from_afar);
    const Optimum fine =
        ascend(geometric_sharpness(rays, SharpnessCriterion::gradient_energy, 1), coarse.lens, box(), {});
    ASSERT_TRUE(fine.converged) << fine.reason;
    // Aberrated alike, so all eyes' optima lie at the same small offset from their refraction.
    EXPECT_NEAR(fine.lens[0] - focus[0], -0.1, 0.02) << i;
    EXPECT_NEAR(fine.lens[1] - focus[1], 0, 0.01) << i;
    EXPECT_NEAR(fine.lens[2] - focus[2], 0, 0.01) << i;
    evaluations += coarse.evaluations + fine.evaluations;
    most = std::max(most, coarse.evaluations + fine.evaluations);
  }
  EXPECT_LE(most, 12);
  RecordProperty("evaluations", evaluations);
  RecordProperty("most", most);
}

TEST(Ascent, GradientEnergyRisesAllTheWayAndTheOthersDoNot) {
  // Why gradient energy is the default: the other two weigh fine detail so much that far from focus they have
  // only the ripples of spurious resolution to ascend.
  const auto rays = aberrated_pupil(entrance_pupil_mm, {0, 0, 0}, 0, 12);
  const auto has_false_slope = [&](SharpnessCriterion criterion) {
    const SharpnessFunction sharpness = geometric_sharpness(rays, criterion, 1);
    for (double M_D = -9; M_D < -0.4; M_D += 0.5)
      if (sharpness(Eigen::Vector3d(M_D, 0, 0)).gradient[0] <= 0) return true;
    return false;
  };
  EXPECT_FALSE(has_false_slope(SharpnessCriterion::gradient_energy));
  EXPECT_TRUE(has_false_slope(SharpnessCriterion::laplacian_variance));
  EXPECT_TRUE(has_false_slope(SharpnessCriterion::mtf_weighted));
}

TEST(Ascent, NeedsAThirdOfNelderMeadsEvaluations) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  int with_derivatives = 0, without = 0;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d focus(4 * unit(random), unit(random), unit(random));
    const SharpnessFunction sharpness = geometric_sharpness(
        aberrated_pupil(entrance_pupil_mm, focus, 0.02, 6), SharpnessCriterion::gradient_energy, 2);
    OptimiserSettings settings;
    settings.depth_of_focus_D = depth_of_focus_D(2);
    const Optimum optimum = ascend(sharpness, Eigen::Vector3d::Zero(), box(), settings);
    const NelderMeadResult simplex =
        nelder_mead([&](const Eigen::VectorXd& lens) { return 1 / std::pow(sharpness(lens).value, 2); },
                    Eigen::Vector3d::Zero(), 1.0, 0.005);
    EXPECT_TRUE(optimum.converged);
    EXPECT_LT((optimum.lens - simplex.position).norm(), 0.02);
    with_derivatives += optimum.evaluations;
    without += simplex.evaluations;
  }
  RecordProperty("with_derivatives", with_derivatives);
  RecordProperty("simplex", without);
  EXPECT_GE(without, 3 * with_derivatives) << without << " against " << with_derivatives;
}

/// One residual, the logarithm of sharpness, for Ceres' checker.
class LogSharpness : public ceres::CostFunction {
 public:
  explicit LogSharpness(SharpnessFunction sharpness) : sharpness_(std::move(sharpness)) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(3);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const SharpnessValue value = sharpness_(Eigen::Map<const Eigen::Vector3d>(parameters[0]));
    residuals[0] = std::log(value.value);
    if (jacobians && jacobians[0]) {
      Eigen::Map<Eigen::Vector3d> jacobian(jacobians[0]);
      jacobian = value.gradient / value.value;
    }
    return true;
  }

 private:
  SharpnessFunction sharpness_;
};

TEST(Ascent, GeometricGradientPassesCeresGradientChecker) {
  for (const SharpnessCriterion criterion : all_criteria) {
    const LogSharpness cost(
        geometric_sharpness(aberrated_pupil(entrance_pupil_mm, {-2, 0.5, 0.3}, 0.05, 6), criterion, 1));
    const ceres::GradientChecker checker(&cost, static_cast<std::vector<const ceres::Manifold*>*>(nullptr),
                                         ceres::NumericDiffOptions());
    const Eigen::Vector3d lens(-1.3, 0.4, 0.6);
    const double* parameters[] = {lens.data()};
    ceres::GradientChecker::ProbeResults results;
    EXPECT_TRUE(checker.Probe(parameters, 1e-6, &results)) << results.error_log;
  }
}

TEST(AcceptedStep, IsShortUnlessTheRaysNoiseIsLonger) {
  EXPECT_EQ(accepted_step_D(0.0003), 0.02);
  EXPECT_EQ(accepted_step_D(0.035), 0.035);
  // what the noise leaves open beyond a quarter of a lens's step is no answer
  EXPECT_EQ(accepted_step_D(0.3), 0.0625);
}

}  // namespace
}  // namespace emmetrope::correction
