#include "segmentation/fit/eye_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/curved_edges.hpp"
#include "segmentation/fit/eye_distances.hpp"
#include "segmentation/fit/globe_candidates.hpp"
#include "segmentation/fit/globe_starts.hpp"
#include "segmentation/fit/residual_judgement.hpp"
#include "segmentation/fit/rician.hpp"
#include "segmentation/fit/slice_displacement.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

/// Deviation of each sample, frozen for a pass: the noise of a Rician magnitude at the model's signal,
/// widened for each stack by what the model does not explain (median of the residuals), so that the loss sees
/// outliers of the misfit and not of the noise alone.
/// \return the factors
VectorXd freeze_weights(FitProblem& problem, const VectorXd& a) {
  const ForwardModel::AtParameters at(*problem.model, a);
  std::vector<std::vector<double>> misfit(problem.model->stacks().size());
  for (Sample& sample : problem.samples) {
    const double noise = problem.model->stacks()[sample.stack].noise;
    const double signal = std::abs(at.intensity(sample, nullptr));
    sample.deviation = static_cast<float>(noise * (problem.rician ? rician(signal / noise).deviation : 1));
    misfit[sample.stack].push_back(std::abs(residual(problem, at, sample)));
  }
  VectorXd factor(static_cast<Eigen::Index>(misfit.size()));
  constexpr double normal_median = 0.6745;
  for (std::size_t s = 0; s < misfit.size(); ++s)
    factor[static_cast<Eigen::Index>(s)] = std::max(1.0, quantile(misfit[s], 0.5) / normal_median);
  for (Sample& sample : problem.samples) sample.deviation *= static_cast<float>(factor[sample.stack]);
  return factor;
}

constexpr std::size_t fewest_voxels = 1000;  ///< that an eye can be fitted to

std::vector<int> range(int first, int last) {
  std::vector<int> indices;
  for (int i = first; i <= last; ++i) indices.push_back(i);
  return indices;
}
void append(std::vector<int>& to, const std::vector<int>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

std::vector<int> stack_parameters(const ForwardModel& model, bool turns) {
  const ParameterLayout& layout = model.layout();
  const std::vector<StackSampling>& stacks = model.stacks();
  std::vector<int> indices;
  for (int s = 0; s < layout.stacks; ++s) {
    const int at = layout.stack(s);
    append(indices, range(at + coil_first, at + coil_first + coil_count - 1));
    // The first stack defines gain and place.
    if (s > 0) append(indices, range(at + log_gain, at + shift_first + 2));
    if (s > 0 && turns) append(indices, range(at + turn_first, at + turn_first + 2));
    indices.push_back(at + log_sharpness);
    for (const int along : {0, 1})
      if (stacks[s].fat_shift_sigma_mm[along] > 0) indices.push_back(at + fat_shift_first + along);
  }
  return indices;
}

/// The parameters that the evidence leaves open: labels have no intensities, coil, sharpness or lid.
std::vector<int> open_parameters(const ParameterLayout& layout, std::vector<int> wanted, Evidence evidence) {
  if (evidence == Evidence::intensities) return wanted;
  const auto known = [&](int parameter) {
    const int in_stack = (parameter - eye_parameter_count) % stack_parameter_count;
    const bool of_stack = parameter >= eye_parameter_count && parameter < layout.displacement();
    return (parameter >= lid_thickness && parameter <= surround) || parameter >= layout.background() ||
           (of_stack && (in_stack < shift_first || in_stack == log_sharpness || in_stack >= fat_shift_first));
  };
  wanted.erase(std::remove_if(wanted.begin(), wanted.end(), known), wanted.end());
  return wanted;
}

/// Everything that a full pass frees.
std::vector<int> all_parameters(const ForwardModel& model) {
  const ParameterLayout& layout = model.layout();
  std::vector<int> indices = range(apex_x, surround);
  append(indices, stack_parameters(model, true));
  append(indices, range(layout.displacement(), layout.size() - 1));
  return indices;
}

/// Pass 1: globe, lens, pose, without the cornea; the apex rides with the globe. In T1 fat and muscle around
/// it differ by more than the globe from either, so that what surrounds it must be free to vary.
SolveResult fit_globe(FitProblem& problem, const VectorXd& start, Evidence evidence, bool varied_surround) {
  std::vector<int> active = range(apex_x, gaze_vertical);
  append(active, {anterior_chamber_depth, lens_thickness, lens_anterior_radius, lens_posterior_radius,
                  globe_x, globe_y, globe_z, wall_lateral, wall_axial, iris_offset, pupil_radius, vitreous,
                  aqueous, wall, lens, iris, surround});
  const ParameterLayout& layout = problem.model->layout();
  append(active, stack_parameters(*problem.model, false));
  const Priors kept = problem.priors;
  if (varied_surround) {
    append(active, range(layout.background(), layout.size() - 1));
    // Nor may the wall become part of it.
    problem.priors.sigma[wall_lateral] /= 2;
    problem.priors.sigma[wall_axial] /= 2;
  }
  problem.loss_scale = 6;
  SolveResult result =
      solve(problem, start, select_parameters(layout.size(), open_parameters(layout, active, evidence)), 16);
  problem.priors = kept;
  return result;
}

/// Pass 2: the front of the eye from five depths of the apex, globe and lens kept in place.
SolveResult fit_cornea(FitProblem& problem, const VectorXd& start, Evidence evidence,
                       std::vector<double>& costs) {
  const int size = problem.model->layout().size();
  const std::vector<int> active =
      open_parameters(problem.model->layout(),
                      {cornea_c, lid_thickness, lid_tilt_x, lid_tilt_y, lid_xx, lid_yy, lid_xy, aqueous,
                       cornea, lid, air, iris, iris_slope, pupil_radius, lens},
                      evidence);
  // The last column slides cornea and lid along the axis: the apex moves out, all that lies behind keeps its
  // place.
  VectorXd slide = VectorXd::Zero(size);
  slide.segment<3>(apex_x) = gaze_axis(start[gaze_horizontal], start[gaze_vertical]);
  for (const int depth : {int(axial_length), int(anterior_chamber_depth)}) slide[depth] = 1;
  Basis basis(size, static_cast<int>(active.size()) + 1);
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t i = 0; i < active.size(); ++i) entries.emplace_back(active[i], static_cast<int>(i), 1);
  for (int i = 0; i < size; ++i)
    if (slide[i] != 0) entries.emplace_back(i, static_cast<int>(active.size()), slide[i]);
  basis.setFromTriplets(entries.begin(), entries.end());

  problem.loss_scale = 3;
  const Priors kept = problem.priors;
  problem.priors.sigma[cornea] = 0.06;
  problem.priors.sigma[lid] = 0.15;
  SolveResult best;
  best.cost = std::numeric_limits<double>::infinity();
  for (const double offset : {-0.8, -0.4, 0.0, 0.4, 0.8}) {
    const VectorXd from = start + offset * slide;
    // The apex is held loosely at its start.
    problem.priors.mean.segment<3>(apex_x) = from.segment<3>(apex_x);
    problem.priors.sigma.segment<3>(apex_x).setConstant(0.4 * std::sqrt(3.0));
    SolveResult result = solve(problem, from, basis, 12);
    costs.push_back(result.cost);
    if (result.cost < best.cost) best = std::move(result);
  }
  const double lowest = *std::min_element(costs.begin(), costs.end());
  for (double& cost : costs) cost -= lowest;
  problem.priors = kept;
  return best;
}

/// The first passes need not use every voxel: a tenth of a voxel is all they are asked for.
int coarse_stride(const std::vector<ObservedStack>& stacks) {
  double voxel_mm3 = 1e9;
  for (const ObservedStack& o : stacks)
    voxel_mm3 = std::min(voxel_mm3,
                         o.stack->row_spacing_mm * o.stack->column_spacing_mm * o.stack->slice_spacing_mm());
  return std::clamp(static_cast<int>(0.8 / voxel_mm3), 1, 6);
}

/// The last passes: everything that is active, then once more with weights that know the misfit. Samples,
/// covariance and judgement go into the fit.
/// \param step_done  called after each
void settle(EyeFit& fit, FitProblem& problem, const std::function<void()>& step_done) {
  problem.model = &fit.model;
  const Basis basis = select_parameters(fit.layout.size(), fit.active);
  const bool faint_wall = fit.contrast == Contrast::t1 && fit.evidence == Evidence::intensities;
  const auto pass = [&](int max_iterations) {
    if (faint_wall) add_curved_edges(problem.samples, fit.model, fit.parameters, fit.stacks);
    SolveResult result = solve(problem, fit.parameters, basis, max_iterations);
    fit.parameters = std::move(result.parameters);
    fit.iterations += result.iterations;
    fit.converged = result.converged;
  };
  // On the way here the globe needs every voxel that holds it.
  Selection last;
  last.optic_nerve = false;
  problem.samples = select_samples(fit.model, fit.parameters, fit.stacks, last);
  if (problem.samples.size() < fewest_voxels) throw no_result_error("too few voxels show the eye");
  fit.misfit = freeze_weights(problem, fit.parameters);
  // Curved edges are those of the eye so far: after the third pass the globe moves by less than 0.01 mm.
  for (int i = 0; i < (faint_wall ? 3 : 1); ++i) pass(25);
  if (step_done) step_done();

  // The balance of image and priors, and the covariance, with weights that know about the misfit.
  const std::array<double, part_count> widening = judge_residuals(fit, problem);
  std::vector<float> deviations;
  for (Sample& sample : problem.samples) {
    deviations.push_back(sample.deviation);
    sample.deviation *= static_cast<float>(std::sqrt(widening[static_cast<std::size_t>(sample.part)]));
  }
  pass(60);
  if (step_done) step_done();
  const Eigen::MatrixXd of_solution = fit.covariance = covariance(problem, fit.parameters, basis);
  fit.covariance = widened_for_coherent_residuals(fit, problem);
  fit.covariance = widened_for_faint_wall(fit);
  if (fit.evidence == Evidence::intensities) {
    const DisplacedSlices displaced = displaced_slices(fit, problem, of_solution);
    fit.slice_displacement_mm = displaced.rms_mm;
    fit.covariance += displaced.covariance;
  }
  // Labels are no smooth surface: what they depart from a biconic is how they were drawn.
  if (!fit.layout.irregular_cornea && fit.evidence == Evidence::intensities)
    fit.irregularity = corneal_irregularity(problem, fit.parameters, fit.active);
  for (std::size_t i = 0; i < deviations.size(); ++i) problem.samples[i].deviation = deviations[i];
  judge_residuals(fit, problem);
  fit.samples = std::move(problem.samples);
}

}  // namespace

double EyeFit::sigma(int parameter) const {
  const auto at = std::find(active.begin(), active.end(), parameter);
  if (at == active.end()) return priors.sigma[parameter] < 1e5 ? priors.sigma[parameter] : 0;
  const auto i = at - active.begin();
  return std::sqrt(covariance(i, i));
}

double EyeFit::pole_depth_sigma_mm() const {
  const VectorXd by = distance_derivatives(*this).col(pole_depth);
  return std::sqrt(std::max(0.0, by.dot(covariance * by)));
}

EyeStart start_of(const FoundEye& eye, std::optional<double> age_years) {
  EyeStart start;
  start.age_years = age_years;
  start.laterality = eye.laterality;
  start.globe_centre = eye.views.front().globe.centre;
  start.globe_radius_mm = eye.radius_mm;
  start.axis = eye.axis;
  start.other_axis = eye.other_axis;
  for (const EyeView& view : eye.views) start.stack_shift.push_back(start.globe_centre - view.globe.centre);
  return start;
}

std::vector<const Stack*> views_of(const FoundEye& eye, const std::vector<const Stack*>& stacks) {
  std::vector<const Stack*> views;
  for (const EyeView& view : eye.views) views.push_back(stacks[view.stack]);
  return views;
}

EyeFit fit_eye(const std::vector<const Stack*>& stacks, const EyeStart& start, Contrast contrast,
               const std::function<void()>& advance, Evidence evidence) {
  ParameterLayout layout;
  layout.stacks = static_cast<int>(stacks.size());
  layout.bumps = static_cast<int>(bump_directions().size());
  const std::vector<ObservedStack> observed = observe(stacks, start, contrast, evidence);
  std::vector<StackSampling> sampling;
  for (const ObservedStack& o : observed) sampling.push_back(o.sampling);
  ForwardModel model(layout, sampling, start.globe_centre);
  const auto step_done = [&] {
    if (advance) advance();
  };

  FitProblem problem;
  problem.model = &model;
  const auto priors_about = [&](const VectorXd& from) {
    Priors priors = population_priors(layout, from, contrast, start.age_years);
    for (int s = 0; s < layout.stacks; ++s)
      for (const int along : {0, 1})
        if (const double sigma = sampling[s].fat_shift_sigma_mm[along]; sigma > 0)
          priors.sigma[layout.stack(s) + fat_shift_first + along] = sigma;
    return priors;
  };
  Selection globe;
  globe.cornea = false;
  globe.fields = contrast == Contrast::t1;
  globe.stride = coarse_stride(observed);
  std::vector<Candidate> candidates;
  for (const std::vector<VectorXd>& starts : globe_starts(model, stacks, start, contrast, evidence)) {
    // On the same voxels from each start along an axis, which reach as far as the first one's.
    problem.samples = select_samples(model, starts.front(), observed, globe);
    if (problem.samples.size() < fewest_voxels) continue;
    freeze_weights(problem, starts.front());
    std::vector<Candidate> along_axis;
    for (const VectorXd& from : starts) {
      problem.priors = priors_about(from);
      along_axis.push_back({fit_globe(problem, from, evidence, globe.fields), problem.priors, {}, {}});
    }
    keep_distinct(along_axis, layout);
    std::move(along_axis.begin(), along_axis.end(), std::back_inserter(candidates));
  }
  if (candidates.empty()) throw no_result_error("too few voxels show the eye");
  step_done();

  const std::vector<int> active = open_parameters(layout, all_parameters(model), evidence);
  for (Candidate& candidate : candidates) {
    VectorXd& a = candidate.solution.parameters;
    const auto adopt = [&](SolveResult result) {
      result.iterations += candidate.solution.iterations;
      candidate.solution = std::move(result);
    };
    problem.priors = candidate.priors;
    problem.rician = false;
    // Once more from there: the start may be a millimetre off and its voxels with it.
    problem.samples = select_samples(model, a, observed, globe);
    freeze_weights(problem, a);
    adopt(fit_globe(problem, a, evidence, globe.fields));

    Selection front;
    front.rear = false;
    problem.samples = select_samples(model, a, observed, front);
    freeze_weights(problem, a);
    adopt(fit_cornea(problem, a, evidence, candidate.apex_costs));

    // The iris keeps its usual thickness at first: a thick one fills the gap before the lens, whose front
    // then settles on the back of the iris.
    const auto but_iris = [](int parameter) {
      return parameter != iris_half_thickness && parameter != iris_slope;
    };
    std::vector<int> first;
    std::copy_if(active.begin(), active.end(), std::back_inserter(first), but_iris);
    problem.loss_scale = 3;
    problem.rician = evidence == Evidence::intensities;
    problem.samples = select_samples(model, a, observed, {});
    freeze_weights(problem, a);
    adopt(solve(problem, a, select_parameters(layout.size(), first), 20));
    if (candidates.size() > 1) candidate.loss = voxel_loss(problem, a);
  }
  const Candidate& best = most_likely(candidates);
  problem.priors = best.priors;
  // That the coil's profile is smooth counts once the globe is in its place: on the way there it must bend.
  for (int s = 0; s < layout.stacks; ++s)
    problem.priors.sigma.segment(layout.stack(s) + coil_second_order, coil_count - coil_second_order)
        .setConstant(sampling[s].coil_curvature_sigma);
  step_done();

  const SolveResult& solution = best.solution;
  EyeFit fit{layout,
             contrast,
             observed,
             model,
             solution.parameters,
             active,
             {},
             problem.priors,
             {},
             {},
             0,
             {},
             {},
             solution.iterations,
             false,
             best.apex_costs};
  fit.evidence = evidence;
  settle(fit, problem, step_done);
  if (fit.irregularity.found()) {
    fit.model = model.with_irregular_cornea();
    fit.layout = fit.model.layout();
    fit.parameters = with_free_form(fit.parameters, fit.layout);
    append(fit.active, range(fit.layout.corneal_form(), fit.layout.size() - 1));
    problem.priors = fit.priors = irregular_cornea_priors(fit.priors, fit.layout);
    settle(fit, problem, {});
  }
  return fit;
}

ParametricEye to_parametric_eye(const EyeFit& fit, Laterality laterality) {
  ParametricEye eye;
  eye.laterality = laterality;
  eye.displacement_directions = bump_directions();
  eye.displacement_mm.assign(eye.displacement_directions.size(), 0);
  eye.displacement_width_rad = bump_width_rad;
  eye.lps_from_eye = lps_from_eye(fit.parameters.segment<3>(apex_x),
                                  gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical)));
  const std::string measured = fit.evidence == Evidence::labels ? "labels" : "mri";
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < fit.active.size(); ++i) {
    const std::string name = fit.layout.name(fit.active[i]);
    if (!has_parameter(eye, name)) continue;
    rows.push_back(static_cast<Eigen::Index>(i));
    eye.parameter_names.push_back(name);
    eye.set(name, fit.parameters[fit.active[i]]);
    const double prior = fit.priors.sigma[fit.active[i]];
    eye.source[name] = fit.sigma(fit.active[i]) > 0.9 * prior ? "prior" : measured;
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  eye.covariance.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) eye.covariance(i, j) = fit.covariance(rows[i], rows[j]);
  eye.iris_diameter_mm = 2 * fit.value(pupil_radius);
  return eye;
}

}  // namespace emmetrope::segmentation
