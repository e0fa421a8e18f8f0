// Which voxels the fit uses, and what a stack says of its coil.
#include "segmentation/fit/observation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/frames.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double eye_mm = 32;  ///< half the side of the smaller stack

/// Coronal slices about the origin, dim and bright in turn, of this extent along the rows.
Stack stack_of(double pixel_mm, double slice_mm, double extent_mm = 2 * eye_mm) {
  Stack stack;
  stack.name = "stack1";
  stack.columns = static_cast<int>(extent_mm / pixel_mm);
  stack.rows = static_cast<int>(2 * eye_mm / pixel_mm);
  stack.along_row = Vector3d::UnitX();
  stack.along_column = -Vector3d::UnitZ();
  stack.normal = stack.along_row.cross(stack.along_column);
  stack.column_spacing_mm = stack.row_spacing_mm = pixel_mm;
  stack.slice_thickness_mm = slice_mm;
  const int slices = static_cast<int>(2 * eye_mm / slice_mm);
  for (int s = 0; s < slices; ++s) {
    stack.slice_position.push_back((s + 0.5) * slice_mm * stack.normal -
                                   Vector3d(extent_mm / 2, eye_mm, -eye_mm));
    std::vector<float> values(static_cast<std::size_t>(stack.rows) * stack.columns);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = 100 + static_cast<float>((i * 7919) % 13);
    stack.slice_intensity.push_back(values);
  }
  return stack;
}

/// An eye at rest with its apex before the origin, and the voxels of a full pass.
struct Voxels {
  ForwardModel model;
  VectorXd parameters;
  std::vector<Sample> samples;

  Vector3d in_eye(const Sample& sample) const {
    return ForwardModel::AtParameters(model, parameters).to_eye(sample.position, sample.stack);
  }
};
Voxels voxels_of(ObservedStack observed, const Selection& selection = {}) {
  ParameterLayout layout;
  layout.bumps = static_cast<int>(bump_directions().size());
  observed.sampling = {observed.stack->along_row, observed.stack->along_column, observed.stack->normal};
  observed.sampling.thickness_mm = observed.stack->slice_thickness_mm;
  Voxels voxels{ForwardModel(layout, {observed.sampling}, Vector3d::Zero()), population_mean(layout), {}};
  voxels.parameters[apex_y] = -12;
  voxels.samples = select_samples(voxels.model, voxels.parameters, {observed}, selection);
  return voxels;
}

TEST(Observation, TheFinestPixelIsTheOneWhoseLongerSideIsShortest) {
  Stack square = stack_of(0.8, 2), oblong = stack_of(0.5, 2);
  oblong.row_spacing_mm = 0.9;
  std::vector<ObservedStack> stacks(2);
  stacks[0].stack = &square;
  stacks[1].stack = &oblong;
  EXPECT_DOUBLE_EQ(finest_pixel_mm(stacks), 0.8);
}

TEST(Voxels, OfTheCorneaEndBeforeTheLimbus) {
  const Stack fine = stack_of(0.4, 1.2), coarse = stack_of(1, 1);
  const auto farthest = [](const Stack& stack) {
    const Voxels voxels = voxels_of({&stack, 1, {}, {}});
    double off_axis = 0;
    for (const Sample& sample : voxels.samples)
      if (sample.zone == Zone::front) off_axis = std::max(off_axis, voxels.in_eye(sample).head<2>().norm());
    return off_axis;
  };
  // The slices lie across the axis: nothing of them reaches farther than a voxel's middle.
  EXPECT_GT(farthest(fine), 4.9);
  EXPECT_LT(farthest(fine), 5.5 - 0.4);
  EXPECT_LT(farthest(coarse), 4.6);
}

TEST(Voxels, OfTheWallSpareTheOpticNerveWhereItIsTold) {
  const Stack stack = stack_of(1, 1);
  const Vector3d nerve(std::sin(15 * degree), 0, -std::cos(15 * degree));
  const auto near_nerve = [&](const std::optional<Vector3d>& told, double within_deg) {
    Selection last;
    last.optic_nerve = false;
    const Voxels voxels = voxels_of({&stack, 1, {}, told}, last);
    const ForwardModel::AtParameters at(voxels.model, voxels.parameters);
    int count = 0;
    for (const Sample& sample : voxels.samples) {
      const auto d = at.distances(voxels.in_eye(sample));
      count += sample.part != Part::vitreous && sample.zone == Zone::rear &&
               d.direction.dot(nerve) > std::cos(within_deg * degree);
    }
    return count;
  };
  EXPECT_GT(near_nerve({}, 13), 30);
  EXPECT_EQ(near_nerve(nerve, 13), 0);
  // The other side of the pole is used.
  EXPECT_GT(near_nerve(nerve, 30), 30);
}

TEST(Observation, TellsTheNerveInT1OnItsNasalSide) {
  const Stack stack = stack_of(1, 1);
  EyeStart start{Vector3d::Zero(), 11.5, -Vector3d::UnitY(), {}, {}, {}, Laterality::od};
  // The nose is to the patient's left of the right eye.
  EXPECT_GT(observe({&stack}, start, Weighting::t1).front().optic_nerve.value().x(), 0.2);
  EXPECT_FALSE(observe({&stack}, start, Weighting::t2).front().optic_nerve);
  start.laterality = Laterality::os;
  EXPECT_LT(observe({&stack}, start, Weighting::t1).front().optic_nerve.value().x(), -0.2);
  start.laterality.reset();
  EXPECT_FALSE(observe({&stack}, start, Weighting::t1).front().optic_nerve);
}

TEST(Observation, AStackOfBothEyesWasMadeWithALargeCoil) {
  const EyeStart start{Vector3d::Zero(), 11.5, -Vector3d::UnitY(), {}, {}, {}, {}};
  const Stack of_one = stack_of(1, 1), of_both = stack_of(1, 1, 100);
  EXPECT_DOUBLE_EQ(observe({&of_one}, start, Weighting::t2).front().sampling.coil_curvature_sigma, 0.2);
  EXPECT_DOUBLE_EQ(observe({&of_both}, start, Weighting::t2).front().sampling.coil_curvature_sigma, 0.1);
}

}  // namespace
}  // namespace emmetrope::segmentation
