#include "segmentation/fit/forward_model.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numeric>
#include <random>

#include "segmentation/fit/edge_response.hpp"
#include "segmentation/fit/least_squares.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

ParameterLayout test_layout() {
  ParameterLayout layout;
  layout.stacks = 2;
  layout.bumps = static_cast<int>(bump_directions().size());
  layout.irregular_cornea = true;
  return layout;
}

ForwardModel test_model() {
  StackSampling coronal{Vector3d::UnitX(), -Vector3d::UnitZ(), Vector3d::UnitY(), 1.6, 1.5, 2, 3, 0.05};
  StackSampling oblique{
      Vector3d(0, 0.8, 0.6), Vector3d(0, 0.6, -0.8), -Vector3d::UnitX(), 1.6, 1.6, 2, 3, 0.05};
  coronal.fat_shift_sigma_mm = oblique.fat_shift_sigma_mm = {0.3, 0.3};
  coronal.muscle_under_wall = oblique.muscle_under_wall = 0.25;
  oblique.fat = 0.45;  // hardly above the wall
  return {test_layout(), {coronal, oblique}, Vector3d(30, 12, 0)};
}

VectorXd test_parameters(unsigned seed) {
  const ParameterLayout layout = test_layout();
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  VectorXd a = population_mean(layout);
  a.segment<5>(0) << 30, 0, 0, 7, -12;
  a[cornea_j0] = 0.003;
  a[cornea_j45] = -0.002;
  a[cornea_q_split] = 0.08;
  a[lens_tilt_x] = 3;
  a[lens_tilt_y] = -2;
  a[lens_decentre_x] = 0.2;
  for (const auto& [tissue, intensity] : {std::pair{vitreous, 1.0},
                                          {aqueous, 0.95},
                                          {wall, 0.3},
                                          {wall_layering, 0.15},
                                          {cornea, 0.25},
                                          {lens, 0.35},
                                          {lens_nucleus, -0.1},
                                          {iris, 0.2},
                                          {lid, 0.5},
                                          {air, 0.02},
                                          {surround, 0.6}})
    a[tissue] = intensity;
  for (int i = 0; i < layout.bumps; ++i) {
    a[layout.displacement() + i] = 0.03 * normal(random);
    a[layout.background() + i] = 0.1 * normal(random);
  }
  for (int i = 0; i < corneal_form_terms; ++i) a[layout.corneal_form() + i] = 4 * normal(random);
  for (int s = 0; s < 2; ++s) {
    for (int i = 0; i < coil_count; ++i) a[layout.stack(s) + i] = 0.1 * normal(random);
  }
  a.segment<3>(layout.stack(1) + shift_first) << 0.3, -0.2, 0.4;
  a.segment<3>(layout.stack(1) + turn_first) << 0.3, -0.2, 0.25;
  a.segment<2>(layout.stack(0) + fat_shift_first) << 0.25, -0.1;
  a.segment<2>(layout.stack(1) + fat_shift_first) << -0.2, 0.15;
  a[layout.stack(0) + log_sharpness_ratio] = 0.15;
  a[layout.stack(0) + k_space_filter] = 0.3;
  a[layout.stack(1) + k_space_filter] = 0.5;
  return a;
}

/// Samples near every surface, in both stacks.
std::vector<Sample> test_samples(const ForwardModel& model, const VectorXd& a) {
  std::vector<Sample> samples;
  const ForwardModel::AtParameters at(model, a);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto bumps = bump_directions();
  while (samples.size() < 1200) {
    Sample sample;
    sample.position = Vector3d(30, 12, 0) + 14 * Vector3d(uniform(random), uniform(random), uniform(random));
    sample.stack = samples.size() % 2;
    const Vector3d p = at.to_eye(sample.position, sample.stack);
    const auto d = at.distances(p);
    const double r = std::hypot(p.x(), p.y()), depth = -p.z();
    sample.zone = depth < 5.3 ? Zone::front : Zone::rear;
    if (sample.zone == Zone::front && r > 4) continue;
    if (sample.zone == Zone::rear && (d.outer < -2 || (r > 5 && depth < 11))) continue;
    sample.near_cornea = sample.near_lens = true;
    if (depth > 10) sample.near_lens = false;
    sample.near_wall = true;
    for (std::size_t i = 0; i < bumps.size(); ++i) {
      if (bumps[i].dot(d.direction) > std::cos(0.96)) sample.bumps.push_back(static_cast<std::uint8_t>(i));
    }
    samples.push_back(sample);
  }
  return samples;
}

/// Each column of the Jacobian against central differences: same direction and same length. What is left out
/// on purpose (the change of the distance's normalisation) costs a few per cent in voxels away from the edge;
/// a wrong sign, factor or missing term is far outside.
void expect_jacobian_of_differences(const ForwardModel& model, const VectorXd& a) {
  const std::vector<Sample> samples = test_samples(model, a);
  const ForwardModel::AtParameters at(model, a);
  const int size = model.layout().size();
  Eigen::MatrixXd analytic(samples.size(), size), numeric(samples.size(), size);
  SparseRow row(size);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    at.intensity(samples[k], &row);
    for (int i = 0; i < size; ++i) analytic(k, i) = row[i];
  }
  for (int i = 0; i < size; ++i) {
    const double step = i == cornea_c || i == cornea_j0 || i == cornea_j45 ? 1e-6 : 1e-5;
    VectorXd more = a, less = a;
    more[i] += step;
    less[i] -= step;
    const ForwardModel::AtParameters above(model, more), below(model, less);
    for (std::size_t k = 0; k < samples.size(); ++k)
      numeric(k, i) =
          (above.intensity(samples[k], nullptr) - below.intensity(samples[k], nullptr)) / (2 * step);
  }
  for (int i = 0; i < size; ++i) {
    const auto by_formula = analytic.col(i), by_differences = numeric.col(i);
    // Bumps that few of the samples see are left to their neighbours.
    if (i >= model.layout().displacement() && by_differences.norm() < 0.4) continue;
    // The first stack defines the place. Of the second: the globe is nearly a ball, turning a stack about its
    // centre moves little, so that what is left out counts for more.
    const auto is_turn = [&](int stack) {
      const int in_stack = i - model.layout().stack(stack);
      return in_stack >= turn_first && in_stack < turn_first + 3;
    };
    if (is_turn(0)) continue;
    const auto is_of_box_profile = [&](int stack) {
      return i == model.layout().stack(stack) + log_sharpness_through &&
             model.stacks()[static_cast<std::size_t>(stack)].slice_cutoff_per_mm == 0;
    };
    if (is_of_box_profile(0) || is_of_box_profile(1)) {
      EXPECT_EQ(by_formula.norm(), 0);
      EXPECT_EQ(by_differences.norm(), 0);
      continue;
    }
    const double same_direction = is_turn(1) ? 0.92 : 0.96;
    const double product = by_formula.dot(by_differences);
    EXPECT_GT(product / (by_formula.norm() * by_differences.norm()), same_direction)
        << model.layout().name(i);
    EXPECT_NEAR(product / by_formula.squaredNorm(), 1, 0.12) << model.layout().name(i);
  }
}

TEST(ForwardModel, JacobianMatchesDifferences) {
  expect_jacobian_of_differences(test_model(), test_parameters(1));
}

TEST(ForwardModel, JacobianOfEncodedSlicesMatchesDifferences) {
  ForwardModel model = test_model();
  for (StackSampling& stack : model.stacks()) {
    stack.slice_cutoff_per_mm = 0.9;
    stack.subslices = 1;
  }
  VectorXd a = test_parameters(1);
  a[model.layout().stack(0) + log_sharpness_through] = 0.1;
  a[model.layout().stack(1) + log_sharpness_through] = -0.1;
  expect_jacobian_of_differences(model, a);
}

/// A border that lies in the slice's plane is as sharp as k-space is cut off through the slices.
TEST(ForwardModel, EncodedSlicesCutTheirBordersOff) {
  ParameterLayout layout;
  StackSampling coronal{-Vector3d::UnitX(), Vector3d::UnitZ(), Vector3d::UnitY(), 0.8, 0.8, 1, 1, 0.05};
  coronal.slice_cutoff_per_mm = 0.5;
  const ForwardModel model(layout, {coronal}, Vector3d::Zero());
  VectorXd a = population_mean(layout);
  const double inside = 0.2, outside = 1;
  a[vitreous] = a[wall] = a[lens] = a[aqueous] = inside;
  a[wall_layering] = a[lens_nucleus] = 0;
  a[surround] = outside;
  a[layout.stack(0) + log_sharpness_through] = std::log(0.9);
  const ForwardModel::AtParameters at(model, a);
  Sample sample;
  sample.zone = Zone::rear;
  sample.near_wall = true;
  const double pole = a[axial_length] + a[wall_axial];  // on the axis, which runs to +y
  for (const double within : {-1.7, -0.6, 0.0, 0.4, 1.1, 2.3}) {
    sample.position = Vector3d(0, pole - within, 0);
    EXPECT_NEAR(at.intensity(sample, nullptr),
                outside + (inside - outside) * edge_response(2 * 0.9 * 0.5 * within), 0.01)
        << within;
  }
}

TEST(ForwardModel, IntensitiesFarFromEdgesAreTheTissues) {
  const ForwardModel model = test_model();
  VectorXd a = test_parameters(1);
  for (int s = 0; s < 2; ++s) a.segment(model.layout().stack(s), coil_count).setZero();
  const ForwardModel::AtParameters at(model, a);
  Sample sample;
  sample.zone = Zone::rear;
  sample.near_lens = sample.near_wall = true;
  const Vector3d axis(std::sin(7 * 0.01745329) * std::cos(12 * 0.01745329),
                      -std::cos(7 * 0.01745329) * std::cos(12 * 0.01745329), -std::sin(12 * 0.01745329));
  sample.position = Vector3d(30, 0, 0) - 14 * axis;
  EXPECT_NEAR(at.intensity(sample, nullptr), 1, 0.02);
  sample.zone = Zone::front;
  sample.near_cornea = true;
  sample.position = Vector3d(30, 0, 0) + 8 * axis;
  EXPECT_NEAR(at.intensity(sample, nullptr), 0.02, 0.02);
}

/// The iris away from pupil and lens is a plane slab thinner than a pixel: the difference of two edges, with
/// the side lobes on either side of it.
TEST(ForwardModel, BlurredIrisIsADifferenceOfEdges) {
  ParameterLayout layout;
  const double cutoff = 0.8, fluid = 1, iris_level = 0.35;
  const ForwardModel model(
      layout, {{-Vector3d::UnitY(), Vector3d::UnitZ(), -Vector3d::UnitX(), cutoff, cutoff, 0.1, 1, 0.05}},
      Vector3d::Zero());
  VectorXd a = population_mean(layout);
  a[iris_slope] = 0;
  a[pupil_radius] = 0.5;
  a[vitreous] = a[aqueous] = a[lens] = fluid;
  a[iris] = iris_level;
  const ForwardModel::AtParameters at(model, a);
  Sample sample;
  sample.zone = Zone::front;
  sample.near_lens = true;
  for (const double behind : {-1.4, -0.9, -0.5, -0.1, 0.0, 0.3, 0.8, 1.2}) {
    // Looking ahead, depth is towards +y.
    sample.position = Vector3d(4.2, a[anterior_chamber_depth] + a[iris_offset] + behind, 0);
    const double half = a[iris_half_thickness];
    const double slab =
        edge_response(2 * cutoff * (behind + half)) - edge_response(2 * cutoff * (behind - half));
    EXPECT_NEAR(at.intensity(sample, nullptr), fluid + (iris_level - fluid) * slab, 2e-3) << behind;
  }
}

/// The head's turn about the reference, then its shift, then the eye's frame.
TEST(ForwardModel, AStackIsTurnedAndShiftedIntoTheFirst) {
  const ForwardModel model = test_model();
  const VectorXd a = test_parameters(1);
  const ForwardModel::AtParameters at(model, a);
  const Vector3d x(25, 3, 7), reference(30, 12, 0), turn_deg(0.3, -0.2, 0.25);
  const Eigen::AngleAxisd turn(turn_deg.norm() * 3.14159265358979 / 180, turn_deg.normalized());
  const Vector3d in_first = turn * (x - reference) + reference + Vector3d(0.3, -0.2, 0.4);
  EXPECT_LT((at.to_eye(x, 1) - at.to_eye(in_first, 0)).norm(), 1e-12);
}

/// Fat displaced along the rows lies over the wall on one side and leaves a gap on the other, and the muscle
/// that is mixed with it stays: edges of a plane wall of two layers, as the globe's is within a thin slice and a voxel.
TEST(ForwardModel, DisplacedFatLiesOverTheWallOrLeavesAGapAndMuscleStays) {
  ParameterLayout layout;
  const double cutoff = 0.8, shift_mm = 0.6, share = 0.45;
  StackSampling axial{
      Vector3d::UnitX(), -Vector3d::UnitZ(), Vector3d::UnitY(), cutoff, cutoff, 0.1, 1, 0.05, {1, 0}};
  axial.muscle_under_wall = 0.25;
  const ForwardModel model(layout, {axial}, Vector3d::Zero());
  VectorXd a = population_mean(layout);
  a[vitreous] = 0.22;
  a[wall] = 0.4;
  a[wall_inner_share] = share;
  a[fat_shift_first + layout.stack(0)] = shift_mm;
  Sample sample;
  sample.near_wall = true;
  struct Surroundings {
    double layering, fat, muscle;  // 1 and 0.4 or 0.3 where there is nothing else
  };
  for (const auto& [layering, of_fat, of_muscle] :
       {Surroundings{0, 1, 0}, {0, 0.5, 0.2}, {0, 0, 0.4}, {0.4, 0.5, 0.15}, {0.4, 0, 0.3}})
    for (const double side : {-1.0, 1.0}) {
      a[surround] = of_fat + of_muscle;
      a[wall_layering] = layering;
      const ForwardModel::AtParameters at(model, a);
      for (const double beyond : {-1.0, -0.4, 0.0, 0.3, 0.7, 1.0, 1.6}) {
        sample.position = Vector3d(side * (a[globe_x] + beyond), a[axial_length] - a[globe_z], 0);
        const auto inside = [&](double edge_at) { return edge_response(2 * cutoff * (edge_at - beyond)); };
        const double inner = inside(0), between = inside(share * a[wall_lateral]),
                     outer = inside(a[wall_lateral]), displaced = inside(a[wall_lateral] + side * shift_mm);
        const double choroid = 0.4 + (1 - share) * layering, sclera = 0.4 - share * layering;
        EXPECT_NEAR(at.intensity(sample, nullptr),
                    0.22 * inner + choroid * (between - inner) + sclera * (outer - between) +
                        of_muscle * (1 - outer) + of_fat * (1 - displaced),
                    4e-3)
            << side * beyond;
      }
    }
}

/// In a thick slice a ball looks smaller: against the average of many thin slices.
TEST(ForwardModel, FewSubslicesSeeTheCurvatureOfTheGlobe) {
  const auto at_wall = [](int subslices, double across_mm) {
    ParameterLayout layout;
    const ForwardModel model(
        layout, {{Vector3d::UnitX(), -Vector3d::UnitZ(), Vector3d::UnitY(), 1.6, 1.6, 2, subslices, 0.05}},
        Vector3d::Zero());
    VectorXd a = population_mean(layout);
    a[vitreous] = a[aqueous] = 1;
    const ForwardModel::AtParameters at(model, a);
    Sample sample;
    sample.near_wall = true;
    sample.position = Vector3d(a[globe_x] + across_mm, a[axial_length] - a[globe_z], 0);
    return at.intensity(sample, nullptr);
  };
  for (const double across : {-0.3, -0.1, 0.0, 0.1, 0.3})
    EXPECT_NEAR(at_wall(3, across), at_wall(40, across), 5e-4) << across;
}

/// By Dubbelman and van der Heijde 2001: radii 12.9 - 0.057 age and 6.2 - 0.012 age, chamber 3.87 - 0.010
/// age, thickness 2.93 + 0.0236 age.
TEST(Priors, OfTheLensFollowThePatientsAge) {
  ParameterLayout layout;
  const VectorXd start = population_mean(layout);
  const Priors unknown = population_priors(layout, start, Weighting::t2);
  EXPECT_NEAR(unknown.mean[lens_anterior_radius], 10.62, 1e-9);
  EXPECT_NEAR(unknown.mean[lens_posterior_radius], 5.72, 1e-9);
  const Priors at_60 = population_priors(layout, start, Weighting::t2, 60);
  EXPECT_NEAR(at_60.mean[lens_anterior_radius], 9.48, 1e-9);
  EXPECT_NEAR(at_60.mean[lens_posterior_radius], 5.48, 1e-9);
  EXPECT_NEAR(at_60.sigma[lens_anterior_radius], 1.232, 1e-3);
  EXPECT_NEAR(at_60.sigma[lens_posterior_radius], 0.572, 1e-3);
  EXPECT_NEAR(at_60.mean[anterior_chamber_depth], 3.27, 1e-9);
  EXPECT_NEAR(at_60.mean[lens_thickness], 4.346, 1e-9);
  EXPECT_NEAR(at_60.sigma[anterior_chamber_depth], 0.316, 1e-3);
  EXPECT_NEAR(at_60.sigma[lens_thickness], 0.309, 1e-3);
  // Nobody has measured the regression in children.
  const Priors child = population_priors(layout, start, Weighting::t2, 6),
               grown_up = population_priors(layout, start, Weighting::t2, 18);
  EXPECT_EQ(child.mean[lens_anterior_radius], grown_up.mean[lens_anterior_radius]);
  for (const Parameter depth : {anterior_chamber_depth, lens_thickness}) {
    EXPECT_EQ(child.mean[depth], unknown.mean[depth]);
    EXPECT_EQ(child.sigma[depth], unknown.sigma[depth]);
  }
  // Nothing else depends on it.
  EXPECT_EQ(at_60.mean.head(anterior_chamber_depth), unknown.mean.head(anterior_chamber_depth));
  EXPECT_EQ(at_60.sigma.tail(layout.size() - lens_posterior_radius - 1),
            unknown.sigma.tail(layout.size() - lens_posterior_radius - 1));
}

/// With the rule: steeper along y, vertically, by 0.6 D. Oblique astigmatism is rarer, and an ectatic cornea
/// may have much of either.
TEST(Priors, CorneasAreSteeperVertically) {
  ParameterLayout layout;
  const VectorXd mean = population_mean(layout);
  const Priors regular = population_priors(layout, mean, Weighting::t1);
  const double horizontal = mean[cornea_c] + mean[cornea_j0], vertical = mean[cornea_c] - mean[cornea_j0];
  EXPECT_NEAR(337.5 * (vertical - horizontal), 0.6, 1e-9);
  EXPECT_EQ(mean[cornea_j45], 0);
  EXPECT_NEAR(337.5 * regular.sigma[cornea_j0], 0.6, 1e-9);
  EXPECT_NEAR(337.5 * regular.sigma[cornea_j45], 0.4, 1e-9);
  layout.irregular_cornea = true;
  const Priors ectatic = irregular_cornea_priors(regular, layout);
  for (const int parameter : {cornea_j0, cornea_j45})
    EXPECT_NEAR(337.5 * ectatic.sigma[parameter], 2.5, 1e-9);
  EXPECT_NEAR(ectatic.sigma[cornea_c], 2.5 * regular.sigma[cornea_c], 1e-12);
}

ForwardModel model_of_one_stack() {
  const StackSampling axial{Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
  return {{}, {axial}, Vector3d::Zero()};
}

/// Without voxels, in T2.
FitProblem of_priors_alone(const ForwardModel& model) {
  FitProblem problem;
  problem.model = &model;
  VectorXd start = population_mean(model.layout());
  start[vitreous] = 1;
  problem.priors = population_priors(model.layout(), start, Weighting::t2);
  problem.limbus_sigma_mm = 0;
  return problem;
}

/// 0.4 D for every millimetre, and the cost of the priors is the quadratic that its derivatives say.
TEST(Priors, LongerEyesHaveFlatterCorneas) {
  const ForwardModel model = model_of_one_stack();
  const FitProblem problem = of_priors_alone(model);
  const VectorXd mean = problem.priors.mean;
  const auto cost = [&](double longer_mm, double steeper_D) {
    VectorXd a = mean;
    a[axial_length] += longer_mm;
    a[cornea_c] += steeper_D / 337.5;
    return evaluate(problem, a, false).cost;
  };
  const double length_sigma = problem.priors.sigma[axial_length];
  EXPECT_NEAR(cost(2, -0.8), std::pow(2 / length_sigma, 2) / 2, 1e-9);
  EXPECT_NEAR(cost(0, -0.8), std::pow(0.8 / 1.5, 2) / 2, 1e-9);
  EXPECT_NEAR(337.5 * (expected_curvature(problem.priors, 25.8) - mean[cornea_c]), -0.8, 1e-9);

  VectorXd at = mean, step = VectorXd::Zero(mean.size());
  at[cornea_c] += 0.004;
  at[axial_length] -= 1.5;
  step[cornea_c] = -0.007;
  step[axial_length] = 2;
  const NormalEquations equations = evaluate(problem, at, true);
  const Eigen::MatrixXd hessian = equations.hessian.selfadjointView<Eigen::Lower>();
  EXPECT_NEAR(evaluate(problem, at + step, false).cost,
              equations.cost + step.dot(equations.gradient) + step.dot(hessian * step) / 2, 1e-9);
}

/// By how much the wall's inner layer is brighter than the outer one.
class GradientOfTheCost : public testing::TestWithParam<double> {};

/// The condensed problem's cost and gradient are those of the voxels, where the wall's layers are inverted or its inner one
/// is as bright as the vitreous too.
TEST_P(GradientOfTheCost, MatchesDifferences) {
  const ForwardModel model = test_model();
  VectorXd a = test_parameters(2);
  a[wall_layering] = GetParam();
  FitProblem problem;
  problem.model = &model;
  problem.samples = test_samples(model, a);
  const ForwardModel::AtParameters at(model, a);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (Sample& sample : problem.samples) {
    sample.value = static_cast<float>(at.intensity(sample, nullptr) + 0.05 * normal(random));
    sample.deviation = 0.05F;
  }
  problem.priors = population_priors(model.layout(), a, Weighting::t2);
  problem.rician = true;
  const NormalEquations equations = evaluate(problem, a, true);
  for (const int i : {int(vitreous), int(wall), int(wall_layering), int(wall_inner_share), int(lens),
                      int(cornea), model.layout().stack(0) + 2, int(lid_thickness), int(pupil_radius)}) {
    VectorXd more = a, less = a;
    more[i] += 1e-5;
    less[i] -= 1e-5;
    const double slope = (evaluate(problem, more, false).cost - evaluate(problem, less, false).cost) / 2e-5;
    EXPECT_NEAR(equations.gradient[i], slope, 0.03 * std::abs(slope) + 3) << model.layout().name(i);
  }
}

INSTANTIATE_TEST_SUITE_P(LeastSquares, GradientOfTheCost, testing::Values(0.15, -0.03, 1.2));

/// Where the layers of the wall change places the prior has neither a step nor a kink, and it is narrow beyond.
TEST(Priors, OfTheWallsLayersAreSmoothWhereTheyChangePlaces) {
  const ForwardModel model = model_of_one_stack();
  const FitProblem problem = of_priors_alone(model);
  const auto at = [&](double layering) {
    VectorXd a = problem.priors.mean;
    a[wall_layering] = layering;
    return evaluate(problem, a, true);
  };
  EXPECT_NEAR(at(-1e-9).cost, at(1e-9).cost, 1e-7);
  EXPECT_NEAR(at(-1e-9).gradient[wall_layering], at(1e-9).gradient[wall_layering], 1e-4);
  const double mean = problem.priors.mean[wall_layering], sigma = problem.priors.sigma[wall_layering];
  EXPECT_NEAR(at(0.1).gradient[wall_layering], (0.1 - mean) / (sigma * sigma), 1e-9);
  EXPECT_NEAR(at(-0.04).gradient[wall_layering], -mean / (sigma * sigma) - 0.04 / (0.02 * 0.02), 1e-9);
  EXPECT_NEAR(at(-0.04).hessian(wall_layering, wall_layering), 1 / (0.02 * 0.02), 1e-9);
}

/// Else a globe might be as small as one likes, what is before its wall being called its inner layer.
TEST(Priors, OfT2AskForAnInnerLayerDarkerThanTheVitreous) {
  const ForwardModel model = model_of_one_stack();
  const FitProblem problem = of_priors_alone(model);
  VectorXd a = problem.priors.mean;
  a[wall] = 0.3;
  a[wall_inner_share] = 0.5;
  const auto by_its_brightness = [&](double inner_layer) {
    const double known = evaluate(problem, a, false).cost, layering = a[wall_layering];
    a[wall_layering] = 2 * (inner_layer - a[wall]);
    const double mean = problem.priors.mean[wall_layering], sigma = problem.priors.sigma[wall_layering];
    const double of_layering =
        (std::pow(a[wall_layering] - mean, 2) - std::pow(layering - mean, 2)) / (2 * sigma * sigma);
    return evaluate(problem, a, false).cost - known - of_layering;
  };
  EXPECT_NEAR(by_its_brightness(0.75), 0, 1e-9);
  EXPECT_GT(by_its_brightness(1.0), 20);
}

/// Whatever number of samples there is, which are summed by blocks.
TEST(LeastSquares, NormalEquationsAreThoseOfTheRows) {
  const ForwardModel model = test_model();
  const VectorXd a = test_parameters(2);
  std::vector<Sample> samples = test_samples(model, a);
  for (Sample& sample : samples) {
    sample.value = 0.3F;
    sample.deviation = 0.05F;
  }
  FitProblem problem;
  problem.model = &model;
  problem.priors = population_priors(model.layout(), a, Weighting::t2);
  problem.limbus_sigma_mm = 0;
  const NormalEquations of_priors = evaluate(problem, a, true);
  const int size = model.layout().size();
  std::vector<int> all(static_cast<std::size_t>(size));
  std::iota(all.begin(), all.end(), 0);
  for (const std::size_t count : {std::size_t{1}, std::size_t{31}, std::size_t{32}, samples.size()}) {
    ASSERT_LE(count, samples.size());
    problem.samples.assign(samples.begin(), samples.begin() + static_cast<std::ptrdiff_t>(count));
    const NormalEquations equations = evaluate(problem, a, true);
    const LinearRows rows = linearise(problem, a, select_parameters(size, all));
    const Eigen::MatrixXd expected = Eigen::MatrixXd(rows.jacobian.transpose() * rows.jacobian);
    const Eigen::MatrixXd lower = (equations.hessian - of_priors.hessian).triangularView<Eigen::Lower>();
    const Eigen::MatrixXd expected_lower = expected.triangularView<Eigen::Lower>();
    EXPECT_NEAR((lower - expected_lower).norm(), 0, 1e-6 * expected.norm()) << count;
    EXPECT_NEAR((equations.gradient - of_priors.gradient - rows.jacobian.transpose() * rows.residual).norm(),
                0, 1e-6 * expected.norm());
  }
}

}  // namespace
}  // namespace emmetrope::segmentation
