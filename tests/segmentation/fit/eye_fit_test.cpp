#include "segmentation/fit/eye_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/phantom_eyes.hpp"

namespace emmetrope::segmentation {
namespace {

EyeStart start_in(const std::vector<const Stack*>& stacks) {
  const FoundEye found = find_eyes(stacks, {""}).eyes.at(0);
  return start_of(found, read_edges_of(found, stacks));
}

/// It shows the way; the eye that is found there is that of its own images, and known as well as they tell.
TEST(EyeFit, AFellowsChamberLeadsAndDoesNotHold) {
  const Stack stack = small_scan(7);
  const std::vector<const Stack*> stacks{&stack};
  EyeStart start = start_in(stacks);
  const EyeFit alone = fit_eye(stacks, start, Weighting::t2);
  start.fellow = alone.parameters;
  start.fellows_chamber_mm = alone.value(anterior_chamber_depth) + 0.4;
  const EyeFit beside = fit_eye(stacks, start, Weighting::t2);
  EXPECT_NEAR(beside.value(anterior_chamber_depth), alone.value(anterior_chamber_depth), 0.03);
  EXPECT_EQ(beside.priors.mean[anterior_chamber_depth], alone.priors.mean[anterior_chamber_depth]);
  EXPECT_EQ(beside.priors.sigma[anterior_chamber_depth], alone.priors.sigma[anterior_chamber_depth]);
  EXPECT_NEAR(beside.sigma(anterior_chamber_depth), alone.sigma(anterior_chamber_depth),
              0.05 * alone.sigma(anterior_chamber_depth));
}

/// Told that they are, aqueous and vitreous are as much more alike, and as much surer to be, as Bayes' rule of two normal
/// distributions says; the eye stays.
TEST(EyeFit, LikeFluidsAreWeighedAgainstTheImage) {
  const Stack stack = small_scan(7);
  const std::vector<const Stack*> stacks{&stack};
  EyeStart start = start_in(stacks);
  const EyeFit free = fit_eye(stacks, start, Weighting::t2);
  start.has_like_fluids = true;
  const EyeFit held = fit_eye(stacks, start, Weighting::t2);
  const auto difference = [](const EyeFit& fit) { return fit.value(aqueous) - fit.value(vitreous); };
  const auto variance = [](const EyeFit& fit) {
    Eigen::VectorXd by = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(fit.active.size()));
    const auto place = [&](int parameter) {
      return std::find(fit.active.begin(), fit.active.end(), parameter) - fit.active.begin();
    };
    by[place(aqueous)] = 1;
    by[place(vitreous)] = -1;
    return by.dot(fit.covariance * by);
  };
  const double of_prior = std::pow(held.priors.aqueous_like_vitreous_sigma, 2), of_image = variance(free),
               share = of_prior / (of_prior + of_image);
  EXPECT_LT(share, 0.95) << "the prior counts";
  EXPECT_NEAR(difference(held) / difference(free), share, 0.02);
  EXPECT_NEAR(variance(held) / of_image, share, 0.02);
  EXPECT_NEAR(held.value(axial_length), free.value(axial_length), 0.02);
}

}  // namespace
}  // namespace emmetrope::segmentation
