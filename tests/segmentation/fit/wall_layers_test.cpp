// How well images show the wall's layers, and what it costs a globe where they do not.
#include "segmentation/fit/wall_layers.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace emmetrope::segmentation {
namespace {

/// Fitted to one stack of such pixels, its edges so steep against the nominal ones.
class WallLayers : public testing::Test {
 protected:
  EyeFit fit_to(Weighting weighting, double pixel_mm, double sharpness) {
    stack_.row_spacing_mm = stack_.column_spacing_mm = pixel_mm;
    ParameterLayout layout;
    layout.stacks = 1;
    EyeFit fit{layout, weighting, {}, ForwardModel(layout, {}, Eigen::Vector3d::Zero())};
    fit.stacks.emplace_back();
    fit.stacks.back().stack = &stack_;
    fit.parameters = Eigen::VectorXd::Zero(layout.size());
    fit.parameters[layout.stack(0) + log_sharpness] = std::log(sharpness);
    return fit;
  }
  Stack stack_;
};

TEST_F(WallLayers, AreHiddenByAWindowAsByCoarsePixels) {
  EXPECT_DOUBLE_EQ(resolved_mm(fit_to(Weighting::t2, 0.6, 0.5)), 1.2);
  EXPECT_DOUBLE_EQ(resolved_mm(fit_to(Weighting::t2, 0.6, 1.2)), 0.6);  // edges are enhanced, voxels stay
  EXPECT_DOUBLE_EQ(error_of_layers_mm(fit_to(Weighting::t2, 0.3, 1)), 0);
  EXPECT_DOUBLE_EQ(error_of_layers_mm(fit_to(Weighting::t2, 0.6, 1)), 0.08);
  EXPECT_NEAR(error_of_layers_mm(fit_to(Weighting::t2, 0.6, 0.75)), (0.08 + 0.3) / 2, 1e-12);
  const double of_t1_mm = error_of_layers_mm(fit_to(Weighting::t1, 1, 1));
  EXPECT_DOUBLE_EQ(error_of_layers_mm(fit_to(Weighting::t2, 0.6, 0.5)), of_t1_mm);
  EXPECT_DOUBLE_EQ(error_of_layers_mm(fit_to(Weighting::t2, 1, 1)), of_t1_mm);
}

TEST_F(WallLayers, AndTheCorneaInT1OrBehindSoftEdgesLeaveTheChamberUnknown) {
  EXPECT_DOUBLE_EQ(error_of_chamber_mm(fit_to(Weighting::t2, 0.6, 1)), 0);
  EXPECT_DOUBLE_EQ(error_of_chamber_mm(fit_to(Weighting::t2, 0.6, 0.55)), 0.1);
  EXPECT_DOUBLE_EQ(error_of_chamber_mm(fit_to(Weighting::t1, 1, 0.55)), 0.1);
}

TEST_F(WallLayers, TellImagesApartThatErrOtherwise) {
  const auto images = [&](Weighting weighting, double pixel_mm, double sharpness) {
    return std::string(images_of_layers(fit_to(weighting, pixel_mm, sharpness)));
  };
  EXPECT_EQ(images(Weighting::t1, 1, 0.6), "");
  EXPECT_EQ(images(Weighting::t2, 0.3, 1), ", fine pixels");
  EXPECT_EQ(images(Weighting::t2, 0.6, 1), "");
  EXPECT_EQ(images(Weighting::t2, 0.6, 0.55), ", soft edges");
}

}  // namespace
}  // namespace emmetrope::segmentation
