#include "segmentation/fit/globe_candidates.hpp"

#include <gtest/gtest.h>

#include <random>

namespace emmetrope::segmentation {
namespace {

/// One stack with a noise of a thirtieth of fat's signal: a voxel that nobody explains costs as much as a residual of 2.4
/// standard deviations.
class MostLikely : public testing::Test {
 protected:
  static std::vector<StackSampling> one_stack() {
    StackSampling stack{Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()};
    stack.noise = 1.0 / 30;
    return {stack};
  }
  /// Explains voxels from the first on with residuals of this standard deviation, and knows of all.
  static Candidate candidate(int explained, double deviation, double prior_cost = 0) {
    constexpr int known = 1000;
    std::mt19937 random(7);
    std::normal_distribution<double> normal(0, deviation);
    Candidate result;
    result.misfit = Eigen::VectorXd::Ones(1);
    result.prior_cost = prior_cost;
    for (int i = 0; i < known; ++i)
      result.residuals[{0, static_cast<double>(i), 0, 0}] =
          i < explained ? std::optional(normal(random)) : std::nullopt;
    return result;
  }
  std::size_t best_of(const std::vector<Candidate>& candidates) const {
    return static_cast<std::size_t>(&most_likely(candidates, model_) - candidates.data());
  }
  ForwardModel model_{ParameterLayout{}, one_stack(), Eigen::Vector3d::Zero()};
};

TEST_F(MostLikely, IsTheGlobeThatExplainsWhatLiesAboutASmallerOne) {
  // The smaller one leaves less of each voxel that it explains.
  EXPECT_EQ(best_of({candidate(600, 0.8), candidate(900, 1)}), 1U);
}

TEST_F(MostLikely, IsNotTheGlobeThatClaimsWhatItDoesNotExplain) {
  Candidate larger = candidate(900, 1);
  for (int i = 600; i < 900; ++i) larger.residuals[{0, static_cast<double>(i), 0, 0}] = 12;  // fat
  EXPECT_EQ(best_of({candidate(600, 1), larger}), 0U);
}

TEST_F(MostLikely, OfTwoNearlyAlikeLeavesLessOfWhatBothExplain) {
  EXPECT_EQ(best_of({candidate(800, 1.02), candidate(796, 1)}), 1U);
}

/// Where the better one of two leaves less, a third that is far from both explains nothing.
TEST_F(MostLikely, OfTwoIsNotChosenByAHopelessThird) {
  Candidate left = candidate(800, 1), right = candidate(800, 1);
  for (int i = 0; i < 100; ++i) *left.residuals[{0, static_cast<double>(i), 0, 0}] *= 0.9;
  for (int i = 100; i < 800; ++i) *right.residuals[{0, static_cast<double>(i), 0, 0}] *= 0.97;
  EXPECT_EQ(best_of({left, right}), 1U);
  EXPECT_EQ(best_of({left, right, candidate(100, 1)}), 1U);
}

TEST_F(MostLikely, IsNotAnEyeThatNoEyeIsLike) {
  EXPECT_EQ(best_of({candidate(800, 1, 400), candidate(800, 1.01, 20)}), 1U);
}

TEST_F(MostLikely, IsTheOnlyOne) { EXPECT_EQ(best_of({Candidate{}}), 0U); }

}  // namespace
}  // namespace emmetrope::segmentation
