#include "segmentation/judgement/two_contrasts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace emmetrope::segmentation {
namespace {

using testing::HasSubstr;

constexpr double length_sigma_mm = 0.3;

/// A measured right eye, seen in one stack, of which the images told the axial length.
JudgedEye eye_of_length(double length_mm, Weighting weighting, std::size_t stack) {
  const ParameterLayout layout;
  EyeFit fit{layout, weighting, {}, ForwardModel(layout, {}, Eigen::Vector3d::Zero())};
  fit.parameters = population_mean(layout);
  fit.priors = population_priors(layout, fit.parameters, weighting);
  fit.active = {axial_length};
  fit.covariance = Eigen::MatrixXd::Constant(1, 1, length_sigma_mm * length_sigma_mm);
  fit.parameters[axial_length] = length_mm;
  JudgedEye eye;
  eye.fit = fit;
  eye.found.weighting = weighting;
  eye.found.views.resize(1);
  eye.found.views[0].stack = stack;
  eye.found.views[0].globe.weighting = weighting;
  eye.found.views[0].merit = weighting == Weighting::t2 ? 200 : 60;
  return eye;
}
JudgedEye in_t2(double length_mm) { return eye_of_length(length_mm, Weighting::t2, 0); }
JudgedEye in_t1(double length_mm) { return eye_of_length(length_mm, Weighting::t1, 1); }

void withhold(JudgedEye& eye, Withholds what, const std::string& reason) {
  QualityGate gate;
  gate.name = "gate";
  gate.passed = false;
  gate.withholds = what;
  gate.reason = reason;
  eye.gates.push_back(gate);
}

/// The eye, with what the other contrast says.
JudgedEye put(const JudgedEye& eye, const JudgedEye& other) {
  std::vector<JudgedEye> eyes{eye};
  put_together(eyes, {other});
  return eyes[0];
}

/// What the finder leaves, explained: it uses the first.
std::vector<StackChoice> explained(const JudgedEye& eye) {
  std::vector<StackChoice> choices(2);
  choices[0].used = true;
  explain_contrasts(choices, {eye});
  return choices;
}

TEST(TwoContrasts, EyesThatAgreeAreJoined) {
  const JudgedEye eye = put(in_t2(24.0), in_t1(24.4));
  ASSERT_TRUE(eye.is_joined);
  EXPECT_EQ(eye.found.weighting, Weighting::t2);
  EXPECT_NEAR(eye.fit->value(axial_length), 24.2, 0.03)
      << "between both, a little farther from the population's";
  EXPECT_NEAR(eye.fit->sigma(axial_length), length_sigma_mm / std::sqrt(2.0), 0.01);
  EXPECT_EQ(eye.in_other_contrast[0].fit->value(axial_length), eye.fit->value(axial_length));
  EXPECT_TRUE(eye.gates.empty());
  EXPECT_EQ(eye.readings().size(), 2U);
  const std::vector<StackChoice> choices = explained(eye);
  EXPECT_TRUE(choices[0].used && choices[1].used);
  EXPECT_THAT(choices[1].reason, HasSubstr("od: fitted by itself, and joined with T2"));
}

TEST(TwoContrasts, EyesThatContradictAreDoubted) {
  const JudgedEye eye = put(in_t2(24.0), in_t1(22.0));
  EXPECT_FALSE(eye.is_joined);
  EXPECT_EQ(eye.fit->value(axial_length), 24.0);
  EXPECT_NEAR(eye.fit->sigma(axial_length), length_sigma_mm * 2.0 / (length_sigma_mm * std::sqrt(2.0)), 1e-9);
  ASSERT_EQ(eye.gates.size(), 1U);
  EXPECT_EQ(eye.gates[0].name, "contrast_difference");
  EXPECT_TRUE(eye.is_measured()) << "a warning";
  EXPECT_THAT(eye.gates[0].reason, HasSubstr("the axial length is 2.0 mm larger in T2"));
  const std::vector<StackChoice> choices = explained(eye);
  EXPECT_TRUE(choices[0].used);
  EXPECT_FALSE(choices[1].used);
}

TEST(TwoContrasts, ThatOfWhichMoreIsKnownStands) {
  JudgedEye refused = in_t2(24.0);
  withhold(refused, Withholds::fit, "the lens is not seen");
  const JudgedEye eye = put(refused, in_t1(22.0));
  EXPECT_EQ(eye.found.weighting, Weighting::t1);
  EXPECT_TRUE(eye.is_measured());
  EXPECT_FALSE(eye.is_joined);
  EXPECT_EQ(eye.fit->value(axial_length), 22.0);
  EXPECT_EQ(eye.in_other_contrast[0].reasons(), "the lens is not seen");
  const std::vector<StackChoice> choices = explained(eye);
  EXPECT_FALSE(choices[0].used);
  EXPECT_TRUE(choices[1].used);
  EXPECT_THAT(choices[0].reason, HasSubstr("od: fitted by itself; T1 stands, as more is known by it"));
  EXPECT_THAT(choices[1].reason, HasSubstr("od: stands"));

  JudgedEye other = in_t1(22.0);
  withhold(other, Withholds::front, "the cornea is not seen");
  const JudgedEye measured = put(in_t2(24.0), other);
  EXPECT_EQ(measured.found.weighting, Weighting::t2);
  EXPECT_EQ(measured.fit->value(axial_length), 24.0) << "of a length that is withheld nothing is taken";
}

TEST(TwoContrasts, OneContrastStandsForBothEyes) {
  JudgedEye right = in_t1(23.8), left = in_t1(23.8), right_in_t2 = in_t2(24.0), left_in_t2 = in_t2(24.0);
  left.found.laterality = left_in_t2.found.laterality = Laterality::os;
  right_in_t2.fit->covariance /= 9;
  left_in_t2.fit->covariance *= 1.2;
  std::vector<JudgedEye> eyes{right, left};
  put_together(eyes, {right_in_t2, left_in_t2});
  for (const JudgedEye& eye : eyes) EXPECT_EQ(eye.found.weighting, Weighting::t2) << "surer of both together";
}

/// Oil in T1 looks like vitreous.
TEST(TwoContrasts, WhatNoHealthyEyeHasCountsForBoth) {
  JudgedEye with_oil = in_t2(24.0);
  withhold(with_oil, Withholds::front, "the fluids are unlike");
  with_oil.gates[0].name = "fluid_difference_t2";
  const JudgedEye eye = put(with_oil, in_t1(24.0));
  EXPECT_EQ(eye.found.weighting, Weighting::t1);
  EXPECT_FALSE(eye.has_front());
  EXPECT_FALSE(eye.is_joined);
  EXPECT_THAT(eye.reasons(), HasSubstr("in T2: the fluids are unlike"));
}

/// Of a fit in the wrong place lens and fluids are no eye's.
TEST(TwoContrasts, WhatARefusedFitTookForLensAndFluidsTellsNothingOfTheOther) {
  for (const char* sign : {"fluid_difference_t2", "natural_lens_mm"})
    for (const bool is_filled_with_oil : {false, true}) {
      JudgedEye refused = in_t2(24.0);
      withhold(refused, Withholds::front, "no healthy eye's");
      refused.gates[0].name = sign;
      withhold(refused, Withholds::fit, "no fit");
      refused.gates[1].name = is_filled_with_oil ? "surroundings_over_vitreous_t2" : "edge_disagreement";
      const JudgedEye eye = put(refused, in_t1(24.0));
      EXPECT_EQ(eye.found.weighting, Weighting::t1);
      EXPECT_EQ(eye.is_measured(), !is_filled_with_oil) << sign;
      EXPECT_FALSE(eye.is_joined);
    }
}

/// What is wall to one fit may be a mass to a globe in the wrong place.
TEST(TwoContrasts, AMassThatARefusedFitSawCountsWhereTheOtherHasItsVitreous) {
  const JudgedEye good = in_t1(24.0);
  const Eigen::Vector3d centre = good.fit->globe_centre_lps(), beside(good.fit->value(globe_x) + 0.5, 0, 0);
  for (const char* sign : {"unexplained_in_vitreous_mm3", "intraocular_mass_mm3"})
    for (const bool is_inside : {true, false}) {
      JudgedEye refused = in_t2(24.0);
      IntraocularMass& mass =
          sign == std::string("intraocular_mass_mm3") ? refused.fit->mass : refused.fit->unexplained;
      mass.voxels.assign(9, is_inside ? centre : centre + beside);
      withhold(refused, Withholds::fit, "no vitreous");
      refused.gates[0].name = sign;
      const JudgedEye eye = put(refused, good);
      EXPECT_EQ(eye.is_measured(), !is_inside) << sign;
      EXPECT_EQ(eye.reasons(), is_inside ? "in T2: no vitreous" : "") << sign;
    }
}

/// An eye that may be another is not made surer by images that were read once.
TEST(TwoContrasts, AnEyeWithARivalIsLeftAlone) {
  JudgedEye ambiguous = in_t2(24.0);
  ambiguous.rival = Rival{*in_t2(25.0).fit, 0.4};
  const JudgedEye eye = put(ambiguous, in_t1(24.2));
  EXPECT_FALSE(eye.is_joined);
  EXPECT_EQ(eye.fit->value(axial_length), 24.0);
}

TEST(TwoContrasts, TheOtherIsWantedWhereItSaysMuchOrMoreIsNotKnown) {
  JudgedEye eye = in_t2(24.0);
  FoundEye other = in_t1(24.0).found;
  EXPECT_TRUE(is_other_contrast_wanted(eye, other));
  other.views[0].merit = 10;
  EXPECT_FALSE(is_other_contrast_wanted(eye, other));
  withhold(eye, Withholds::cornea, "the cornea is not seen");
  EXPECT_TRUE(is_other_contrast_wanted(eye, other));
}

TEST(TwoContrasts, AStackThatIsNotFittedSaysSo) {
  JudgedEye eye = in_t2(24.0);
  eye.found.left_out = in_t1(24.0).found.views;
  const std::vector<StackChoice> choices = explained(eye);
  EXPECT_FALSE(choices[1].used);
  EXPECT_THAT(choices[1].reason, HasSubstr("od: not used"));
}

}  // namespace
}  // namespace emmetrope::segmentation
