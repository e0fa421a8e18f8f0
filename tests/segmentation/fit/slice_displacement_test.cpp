#include "segmentation/fit/slice_displacement.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double half_side_mm = 20, pixel_mm = 1, slice_mm = 2;

Stack coronal_stack() {
  Stack stack;
  stack.name = "stack1";
  stack.columns = stack.rows = static_cast<int>(2 * half_side_mm / pixel_mm);
  stack.along_row = Vector3d::UnitX();
  stack.along_column = -Vector3d::UnitZ();
  stack.normal = stack.along_row.cross(stack.along_column);
  stack.column_spacing_mm = stack.row_spacing_mm = pixel_mm;
  stack.slice_thickness_mm = slice_mm;
  for (double along = 0.5 * slice_mm; along < 2 * half_side_mm; along += slice_mm) {
    stack.slice_position.push_back((along - half_side_mm) * stack.normal -
                                   Vector3d(half_side_mm, 0, -half_side_mm));
    stack.slice_intensity.emplace_back(static_cast<std::size_t>(stack.rows) * stack.columns, 1.0F);
  }
  return stack;
}

/// An eye in T2 at rest about the origin, as the model has it.
struct StillEye {
  Stack stack = coronal_stack();
  EyeFit fit = made();
  FitProblem problem;
  Basis basis;

  StillEye() {
    problem.model = &fit.model;
    problem.priors = fit.priors;
    problem.samples = select_samples(fit.model, fit.parameters, fit.stacks, {});
    for (Sample& sample : problem.samples) sample.deviation = 0.02F;
    basis = select_parameters(fit.layout.size(), fit.active);
  }

 private:
  EyeFit made() {
    ObservedStack observed;
    observed.stack = &stack;
    observed.sampling = {stack.along_row, stack.along_column, stack.normal};
    observed.sampling.row_cutoff_per_mm = observed.sampling.column_cutoff_per_mm = 0.5 / pixel_mm;
    observed.sampling.thickness_mm = slice_mm;
    observed.sampling.subslices = 3;
    ParameterLayout layout;
    layout.bumps = static_cast<int>(bump_directions().size());
    EyeFit eye{layout, Weighting::t2, {observed}, {layout, {observed.sampling}, Vector3d::Zero()}};
    eye.parameters = population_mean(layout);
    eye.parameters[apex_y] = -12;
    for (const auto& [tissue, intensity] : {std::pair{vitreous, 1.0},
                                            {aqueous, 0.95},
                                            {wall, 0.2},
                                            {cornea, 0.25},
                                            {lens, 0.2},
                                            {iris, 0.35},
                                            {lid, 0.4},
                                            {air, 0.02},
                                            {surround, 0.6}})
      eye.parameters[tissue] = intensity;
    eye.priors = population_priors(layout, eye.parameters, eye.weighting);
    eye.active = {apex_x, apex_y, apex_z, axial_length, globe_x, globe_y, globe_z, lens_thickness};
    return eye;
  }
};

}  // namespace

/// Slices moved singly, along all three axes alike: what the fits of many such scans come to lies as far from the eye as the
/// covariance says.
TEST(DisplacedSlices, CoverWhatMovedSlicesMakeOfTheEye) {
  constexpr double moved_mm = 0.1;
  constexpr int scans = 40;
  StillEye eye;
  const VectorXd truth = eye.fit.parameters;
  const std::vector<Sample> still = eye.problem.samples;
  const Blocks slice_of = slices_of(eye.fit, still);
  const ForwardModel::AtParameters at(eye.fit.model, truth);
  std::mt19937_64 random(7);
  std::normal_distribution<double> along_axis(0, moved_mm);
  VectorXd squares = VectorXd::Zero(static_cast<Eigen::Index>(eye.fit.active.size())), stated = squares;
  for (int scan = 0; scan < scans; ++scan) {
    std::map<int, Vector3d> moved;
    for (std::size_t i = 0; i < still.size(); ++i) {
      const auto found = moved.try_emplace(slice_of[i], Vector3d::Zero());
      if (found.second)
        found.first->second = Vector3d(along_axis(random), along_axis(random), along_axis(random));
      Sample elsewhere = still[i];
      elsewhere.value = 0;
      elsewhere.position += found.first->second;
      eye.problem.samples[i].value =
          static_cast<float>(-residual(eye.problem, at, elsewhere) * elsewhere.deviation);
    }
    eye.fit.parameters = solve(eye.problem, truth, eye.basis, {20}).parameters;
    const Eigen::MatrixXd of_solution = covariance(eye.problem, eye.fit.parameters, eye.basis);
    stated += displaced_slices(eye.fit, eye.problem, of_solution).covariance.diagonal() / scans;
    for (Eigen::Index i = 0; i < squares.size(); ++i) {
      const int parameter = eye.fit.active[static_cast<std::size_t>(i)];
      squares[i] += std::pow(eye.fit.parameters[parameter] - truth[parameter], 2) / scans;
    }
  }
  // Of 40 scans a mean square is known to a factor of 1 +- 0.22.
  const VectorXd ratio = squares.cwiseQuotient(stated);
  EXPECT_NEAR(ratio.mean(), 1, 0.25) << ratio.transpose();
  EXPECT_GT(ratio.minCoeff(), 0.5) << ratio.transpose();
  EXPECT_LT(ratio.maxCoeff(), 2) << ratio.transpose();
}

}  // namespace emmetrope::segmentation
