#include "segmentation/judgement/clipped_values.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "pipeline/base/files.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/intake/nifti.hpp"
#include "segmentation/judgement/judged_eye.hpp"
#include "segmentation/stage.hpp"
#include "tests/support/phantom_eyes.hpp"
#include "tests/support/temporary_folder.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// An eye as the population has it, looking straight ahead, and a cube of 40 mm about it in T1: whole numbers with
/// noise, and one voxel as bright as a vessel.
class ClippedEye : public testing::Test {
 protected:
  ClippedEye() {
    fit_.parameters = population_mean(layout_);
    for (int i = vitreous; i <= surround; ++i) fit_.parameters[i] = i == vitreous ? 0.2 : 1;
    fit_.priors = population_priors(layout_, fit_.parameters, Weighting::t1);
    for (int i = 0; i < layout_.size(); ++i) fit_.active.push_back(i);
    fit_.covariance = 1e-6 * Eigen::MatrixXd::Identity(layout_.size(), layout_.size());
    fit_.regions.resize(part_count);
    fit_.misfit = Eigen::VectorXd::Ones(1);

    constexpr int size = 50;
    constexpr double pixel_mm = 0.8;
    const Vector3d corner = fit_.globe_centre_lps() - Vector3d::Constant(size * pixel_mm / 2);
    stack_.columns = stack_.rows = size;
    stack_.along_row = Vector3d::UnitX();
    stack_.along_column = Vector3d::UnitY();
    stack_.normal = Vector3d::UnitZ();
    stack_.row_spacing_mm = stack_.column_spacing_mm = stack_.slice_thickness_mm = pixel_mm;
    for (int s = 0; s < size; ++s) {
      stack_.slice_position.emplace_back(corner + s * pixel_mm * stack_.normal);
      stack_.slice_intensity.emplace_back(size * size);
    }
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 20);
    const Vector3d lens_middle = fit_.globe_centre_lps() - (fit_.value(axial_length) - fit_.value(globe_z) -
                                                            fit_.value(anterior_chamber_depth) - 2) *
                                                               Vector3d::UnitY();
    set_values([&](const Vector3d& at, float) {
      const double level = (at - lens_middle).norm() < 2.5                ? 600
                           : (at - fit_.globe_centre_lps()).norm() < 11.5 ? 200
                                                                          : 900;
      return std::round(std::max(0.0, level + noise(random)));
    });
    stack_.slice_intensity[0][0] = 4095;
  }

  void set_values(const std::function<double(const Vector3d& at, float value)>& value_at) {
    for (int s = 0; s < stack_.slices(); ++s)
      for (int r = 0; r < stack_.rows; ++r)
        for (int c = 0; c < stack_.columns; ++c) {
          float& value = stack_.slice_intensity[s][static_cast<std::size_t>(r) * stack_.columns + c];
          value = static_cast<float>(value_at(stack_.position(c, r, s), value));
        }
  }
  void clip(double low, double high) {
    set_values([&](const Vector3d&, float value) { return std::clamp<double>(value, low, high); });
  }
  /// What the gates of clipping say.
  JudgedEye judged() {
    ObservedStack observed;
    observed.stack = &stack_;
    JudgedEye eye;
    eye.found.views.resize(1);
    eye.fit = fit_;
    eye.fit->stacks = {observed};
    StackSampling sampling;
    sampling.along_row = stack_.along_row;
    sampling.along_column = stack_.along_column;
    sampling.normal = stack_.normal;
    eye.fit->model = ForwardModel(layout_, {sampling}, Vector3d::Zero());
    for (const QualityGate& gate : judge_quality(eye.found, *eye.fit, std::nullopt))
      if (gate.name.rfind("clipped_", 0) == 0) eye.gates.push_back(gate);
    EXPECT_EQ(eye.gates.size(), 3U);
    return eye;
  }
  static ReadEye edges_with_length() {
    ReadEye edges{};
    edges.reading.globe.centre.setZero();
    edges.reading.lens_centre.setZero();
    edges.biometry.axial_length = Estimate{24, 0.5};
    return edges;
  }
  static int failed(const JudgedEye& eye) {
    return static_cast<int>(std::count_if(eye.gates.begin(), eye.gates.end(),
                                          [](const QualityGate& gate) { return !gate.passed; }));
  }

  const ParameterLayout layout_;
  EyeFit fit_{layout_, Weighting::t1, {}, ForwardModel(layout_, {}, Vector3d::Zero())};
  Stack stack_;
};

TEST_F(ClippedEye, ABlankedFaceIsNotClipped) {
  const double lens_back_y = fit_.globe_centre_lps().y() - 4;
  set_values([&](const Vector3d& at, float value) { return at.y() < lens_back_y ? 0.0 : value; });
  EXPECT_EQ(failed(judged()), 0);
}

TEST_F(ClippedEye, AScannersGreyValuesAreWhole) {
  EXPECT_EQ(failed(judged()), 0);
  clip(0, 950);  // above all but little of the fat
  EXPECT_EQ(failed(judged()), 0);
}

TEST_F(ClippedEye, FatAloneIsAWarning) {
  clip(0, 800);
  const JudgedEye eye = judged();
  EXPECT_EQ(failed(eye), 1);
  EXPECT_TRUE(eye.is_measured());
  EXPECT_GT(eye.gates[0].value, 0.3);
  EXPECT_NE(eye.gates[0].reason.find("clipped at 800"), std::string::npos) << eye.gates[0].reason;
}

/// Of a lens as white as the fat around the globe neither edge lies half way up.
TEST_F(ClippedEye, AClippedLensLosesItsFront) {
  clip(0, 500);
  JudgedEye eye = judged();
  EXPECT_TRUE(eye.is_fitted());
  EXPECT_FALSE(eye.has_front());
  EXPECT_NE(eye.reasons().find("% of the lens"), std::string::npos) << eye.reasons();
  eye.edges = {edges_with_length()};
  EXPECT_EQ(eye.edges_on_axis_withheld(), eye.reasons());
}

TEST_F(ClippedEye, ABlackVitreousLosesTheGlobe) {
  clip(300, 5000);
  JudgedEye eye = judged();
  eye.edges = {edges_with_length()};
  EXPECT_STREQ(eye.status(), "refused");
  EXPECT_NE(eye.reasons().find("clipped at 300"), std::string::npos) << eye.reasons();
}

/// A fit that came to no end says nothing of it, and edges would stand.
TEST_F(ClippedEye, ABlackVitreousIsToldWithoutAFit) {
  clip(300, 5000);
  JudgedEye eye;
  eye.edges = {edges_with_length()};
  eye.gates = judge_without_fit("no end", {&stack_}, {fit_.globe_centre_lps()});
  EXPECT_NE(eye.reasons().find("no end"), std::string::npos);
  EXPECT_NE(eye.reasons().find("clipped at 300"), std::string::npos) << eye.reasons();
  EXPECT_FALSE(eye.is_read());
}

TEST_F(ClippedEye, EdgesStandWithoutAFitWhereNothingWasClipped) {
  JudgedEye eye;
  eye.edges = {edges_with_length()};
  eye.gates = judge_without_fit("no end", {&stack_}, {fit_.globe_centre_lps()});
  EXPECT_EQ(eye.reasons(), "no end");
  EXPECT_TRUE(eye.is_read());
}

/// Labels are few values by themselves.
TEST_F(ClippedEye, LabelsAreNotClipped) {
  clip(300, 500);
  fit_.evidence = Evidence::labels;
  EXPECT_EQ(failed(judged()), 0);
}

/// What a viewer saves of a window that shows a lens white.
TEST(ClippedScan, OfAWindowedPhantomNoLensIsTold) {
  const test::TemporaryFolder folder;
  const phantom::HeadGeometry head = phantom::sample_head();
  Stack stack = small_scan(head, "t1");
  const phantom::Anatomy anatomy(head);
  const Vector3d lens = anatomy.eye(Laterality::od).lps_from_eye *
                        Vector3d(0, 0, -head.od.anterior_chamber_depth_mm - head.od.lens_thickness_mm / 2);
  std::vector<double> of_lens;
  for_each_voxel_near(stack, lens, 1.5,
                      [&](int c, int r, int s, const Vector3d&) { of_lens.push_back(stack.at(c, r, s)); });
  const auto white = static_cast<float>(0.8 * quantile(of_lens, 0.5));
  for (std::vector<float>& slice : stack.slice_intensity)
    for (float& value : slice) value = std::round(255 * std::min(1.0F, value / white));
  write_nifti(folder.path() / "windowed.nii.gz", stack);
  SegmentOptions options;
  options.study = folder.path() / "windowed.nii.gz";
  options.case_folder = folder.path() / "case";
  CommonOptions common;
  common.verbosity.quiet = true;
  common.laterality = LateralityChoice::od;
  EXPECT_EQ(segment(options, common).status, ExitStatus::partial);
  const Json fit = read_json(options.case_folder / "segmentation" / "od" / "fit.json");
  EXPECT_NE(fit.at("withheld").at("front").dump().find("clipped at 255"), std::string::npos)
      << fit.at("withheld");
}

}  // namespace
}  // namespace emmetrope::segmentation
