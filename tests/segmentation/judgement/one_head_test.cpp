#include "segmentation/judgement/one_head.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/base/error.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

/// Two eyes in two stacks, between which the first one's globe moved by `right` and the other's by `left`.
struct Head {
  Stack first, second;
  std::vector<JudgedEye> eyes;

  Head(const Vector3d& right, const Vector3d& left) {
    first.name = "stack1";
    second.name = "stack2";
    for (const auto& [x, moved] : {std::pair{-31.0, right}, std::pair{31.0, left}}) {
      JudgedEye eye = reading({&first, &second}, {x, 0, 0});
      eye.fit->parameters.segment<3>(eye.fit->layout.stack(1) + shift_first) = moved;
      eyes.push_back(eye);
    }
  }

  static JudgedEye reading(const std::vector<const Stack*>& stacks, const Vector3d& apex) {
    ParameterLayout layout;
    layout.stacks = static_cast<int>(stacks.size());
    EyeFit fit{layout, Weighting::t2, {}, ForwardModel(layout, {}, Vector3d::Zero())};
    fit.parameters = population_mean(layout);
    fit.parameters.segment<3>(apex_x) = apex;
    for (const Stack* stack : stacks) {
      ObservedStack observed{};
      observed.stack = stack;
      fit.stacks.push_back(observed);
    }
    JudgedEye eye;
    eye.fit = fit;
    return eye;
  }
};

TEST(OneHead, MayHaveMoved) {
  EXPECT_NO_THROW(check_one_head(Head({3, -2, 5}, {3, -2, 5}).eyes));
  EXPECT_NO_THROW(check_one_head(Head({0, 0, 0}, {1, 0, 0}).eyes));
}

TEST(OneHead, HasItsGlobesEquallyFarApart) {
  const Head two({0, 0, 0}, {-3.4, 0, 0});
  try {
    check_one_head(two.eyes);
    FAIL() << "taken for one head";
  } catch (const Error& error) {
    EXPECT_EQ(error.status(), ExitStatus::input_invalid);
    EXPECT_THAT(error.what(), HasSubstr("62.0 mm apart in stack1 and 65.4 mm in stack2"));
  }
}

TEST(OneHead, IsSeenAcrossContrasts) {
  Head head({0, 0, 0}, {0, 0, 0});
  Stack third;
  third.name = "stack3";
  for (JudgedEye& eye : head.eyes)
    eye.in_other_contrast = {Head::reading({&third}, {eye.fit->parameters[apex_x] * 1.1, 0, 0})};
  EXPECT_THROW(check_one_head(head.eyes), Error);
}

TEST(OneHead, IsNotDoubtedByFitsThatAreWithheld) {
  Head two({0, 0, 0}, {-3.4, 0, 0});
  QualityGate gate;
  gate.passed = false;
  gate.withholds = Withholds::fit;
  two.eyes[0].gates.push_back(gate);
  EXPECT_NO_THROW(check_one_head(two.eyes));
}

}  // namespace
}  // namespace emmetrope::segmentation
