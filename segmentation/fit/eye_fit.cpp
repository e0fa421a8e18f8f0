#include "segmentation/fit/eye_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/population/population.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/acquired_resolution.hpp"
#include "segmentation/fit/curved_edges.hpp"
#include "segmentation/fit/eye_distances.hpp"
#include "segmentation/fit/fit_passes.hpp"
#include "segmentation/fit/globe_candidates.hpp"
#include "segmentation/fit/globe_starts.hpp"
#include "segmentation/fit/patient_frame.hpp"
#include "segmentation/fit/residual_judgement.hpp"
#include "segmentation/fit/slice_displacement.hpp"
#include "segmentation/fit/wall_layers.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::VectorXd;

constexpr std::size_t fewest_voxels = 1000;  ///< that an eye can be fitted to
/// Independent ones, where the image was interpolated. Chosen: eyes of real heads whose k-space was cut had 500 to 1070
/// where fits became 0.7 to 1.7 mm too small, 1300 where they stayed right.
constexpr double fewest_independent_voxels = 1200;
constexpr double unseen_gaze_sigma_deg = 10;  ///< where an eye looks whose front is blanked; chosen
constexpr double unknown_sigma = 1e5;         ///< a prior that wide is none
/// In T1 choroid and retina are brighter than the sclera, which beside bright fat is hardly seen. In units of the wall.
/// Chosen: with a mean of none a real eye was fitted with a wall darker than its vitreous.
constexpr double layering_beside_dark_fat = 0.2, layering_sigma_beside_dark_fat = 0.4;
/// Fat is displaced alike about both eyes; how far the fellow's is to be trusted was chosen.
constexpr double fellows_fat_shift_sigma_mm = 0.15;
/// So that the iris or the lid is not taken for the cornea; in the last passes the population's prior holds. Chosen.
constexpr double fellows_chamber_sigma_mm = 0.2;

/// On the way. Chosen: of 58 eyes by a surface coil the iris of two ended in another minimum, 0.26 steep where others are
/// within 0.07, and their corneas with it, one by 0.6 of asphericity and 1.6 D.
constexpr double steadied_iris_slope_sigma_t2 = 0.05;

/// The first passes need not use every voxel: a tenth of a voxel is all they are asked for.
int coarse_stride(const std::vector<ObservedStack>& stacks) {
  double voxel_mm3 = 1e9;
  for (const ObservedStack& o : stacks)
    voxel_mm3 = std::min(voxel_mm3,
                         o.stack->row_spacing_mm * o.stack->column_spacing_mm * o.stack->slice_spacing_mm());
  return std::clamp(static_cast<int>(0.8 / voxel_mm3), 1, 6);
}

/// \throw Error (no_result)
void check_voxels(const std::vector<Sample>& samples, const std::vector<ObservedStack>& stacks,
                  Evidence evidence) {
  std::vector<double> of_stack(stacks.size(), 0.0);
  for (const Sample& sample : samples) ++of_stack[sample.stack];
  double independent = 0;
  for (std::size_t k = 0; k < stacks.size(); ++k)
    independent += evidence == Evidence::labels
                       ? of_stack[k]
                       : acquired_resolution(*stacks[k].stack).independent(of_stack[k]);
  if (samples.size() < fewest_voxels)
    throw no_result_error(
        fmt::format("too few voxels show the eye: {}, and a fit needs {}", samples.size(), fewest_voxels));
  const bool is_interpolated = independent < 0.95 * static_cast<double>(samples.size());
  if (is_interpolated && independent < fewest_independent_voxels)
    throw no_result_error(fmt::format(
        "too few voxels show the eye: {:.0f} independent ones (the image was smoothed, or interpolated to the "
        "{} that are stored), and a fit needs {:.0f}",
        independent, samples.size(), fewest_independent_voxels));
}

/// An eye in its images, and what is known of it before they are seen. It is sought along the voxels' axes: which of several
/// minima is found does not hang on how the header turns them.
struct ImagedEye {
  Weighting weighting;
  Evidence evidence;
  std::optional<double> age_years;
  VectorXd fellow;  ///< parameters of the other eye in the same stacks; empty: not known
  std::optional<double> fellows_chamber_mm;
  std::vector<ObservedStack> stacks;
  ForwardModel model;
};
ImagedEye imaged_eye(const std::vector<const Stack*>& stacks, const EyeStart& start, Weighting weighting,
                     Evidence evidence) {
  ParameterLayout layout;
  layout.stacks = static_cast<int>(stacks.size());
  layout.bumps = static_cast<int>(bump_directions().size());
  std::vector<ObservedStack> observed = observe(stacks, start, weighting, evidence);
  std::vector<StackSampling> sampling;
  for (const ObservedStack& o : observed) sampling.push_back(o.sampling);
  return {
      weighting,
      evidence,
      start.age_years,
      start.fellow,
      start.fellows_chamber_mm,
      std::move(observed),
      ForwardModel(layout, std::move(sampling), start.globe_centre).along(axes_of_voxels(*stacks.front()))};
}

Priors priors_about(const ImagedEye& eye, const VectorXd& start) {
  const ParameterLayout& layout = eye.model.layout();
  Priors priors = population_priors(layout, start, eye.weighting, eye.age_years);
  if (fat_is_dark(eye.stacks)) {
    priors.mean[wall_layering] = layering_beside_dark_fat;
    priors.sigma[wall_layering] = layering_sigma_beside_dark_fat;
  }
  if (front_is_blanked(eye.stacks)) {
    for (const int gaze : {gaze_horizontal, gaze_vertical}) {
      priors.mean[gaze] = 0;  // straight ahead
      priors.sigma[gaze] = unseen_gaze_sigma_deg;
    }
  }
  for (int s = 0; s < layout.stacks; ++s)
    for (const int along : {0, 1}) {
      const double sigma = eye.model.stacks()[s].fat_shift_sigma_mm[along];
      if (!(sigma > 0)) continue;
      const int at = layout.stack(s) + fat_shift_first + along;
      priors.sigma[at] = sigma;
      if (eye.fellow.size() == 0) continue;
      priors.mean[at] = eye.fellow[at];
      priors.sigma[at] = std::min(sigma, fellows_fat_shift_sigma_mm);
    }
  return priors;
}

/// Whether pixels are no finer than a cornea is thick: a dark line in T2, which looks as wide as the image is sharp. Where that
/// differs between axes corneas were fitted 0.07 mm too thin in the mean of 32 eyes of `scanner`, up to 0.19
/// (docs/evidence/worlds.md).
/// Labels show it as it was drawn.
bool hides_thickness(Weighting weighting, Evidence evidence, const std::vector<ObservedStack>& stacks) {
  constexpr double thin_mm = 0.5;
  return weighting == Weighting::t2 && evidence == Evidence::intensities &&
         finest_pixel_mm(stacks) >= thin_mm;
}

/// While an eye is sought.
Priors held_where_unseen(Priors priors, Weighting weighting, Evidence evidence,
                         const std::vector<ObservedStack>& stacks) {
  constexpr double held_mm = 0.003;
  if (hides_thickness(weighting, evidence, stacks)) priors.sigma[cornea_thickness] = held_mm;
  return priors;
}

/// Those on the way to the eye, too.
Priors priors_on_the_way(const ImagedEye& eye, const VectorXd& start) {
  Priors priors = priors_about(eye, start);
  if (!eye.fellows_chamber_mm) return priors;
  priors.mean[anterior_chamber_depth] = *eye.fellows_chamber_mm;
  priors.sigma[anterior_chamber_depth] = fellows_chamber_sigma_mm;
  return priors;
}

/// The voxels of a globe's fit.
Selection globe_selection(const ImagedEye& eye) {
  Selection globe;
  globe.cornea = false;
  globe.fields = eye.weighting == Weighting::t1;
  globe.stride = coarse_stride(eye.stacks);
  return globe;
}

/// The globes that the starts lead to.
/// \param starts  along each axis
std::vector<Candidate> globe_candidates(const ImagedEye& eye,
                                        const std::vector<std::vector<VectorXd>>& starts_by_axis) {
  const Selection globe = globe_selection(eye);
  FitProblem problem;
  problem.model = &eye.model;
  std::vector<Candidate> candidates;
  for (const std::vector<VectorXd>& starts : starts_by_axis) {
    // On the same voxels from each start along an axis, which reach as far as the first one's.
    problem.samples = select_samples(eye.model, starts.front(), eye.stacks, globe);
    if (problem.samples.size() < fewest_voxels) continue;
    freeze_deviations(problem, starts.front());
    std::vector<Candidate> along_axis;
    for (const VectorXd& start : starts) {
      problem.priors = priors_on_the_way(eye, start);
      along_axis.push_back({fit_globe(problem, start, eye.evidence, globe.fields), problem.priors});
    }
    keep_distinct(along_axis, eye.model.layout());
    std::move(along_axis.begin(), along_axis.end(), std::back_inserter(candidates));
  }
  return candidates;
}

/// From a globe to a whole eye: the globe once more, the cornea, everything.
/// \return the last problem, which the candidate solves
FitProblem complete(Candidate& candidate, const ImagedEye& eye) {
  const Selection globe = globe_selection(eye);
  Selection front;
  front.rear = false;
  FitProblem problem;
  problem.model = &eye.model;
  problem.priors = held_where_unseen(candidate.priors, eye.weighting, eye.evidence, eye.stacks);
  if (eye.weighting == Weighting::t2) problem.priors.sigma[iris_slope] = steadied_iris_slope_sigma_t2;
  const auto prepare = [&](const Selection& selection) -> const VectorXd& {
    const VectorXd& start = candidate.solution.parameters;
    problem.samples = select_samples(eye.model, start, eye.stacks, selection);
    freeze_deviations(problem, start);
    return start;
  };
  const auto adopt = [&](SolveResult result) {
    result.iterations += candidate.solution.iterations;
    candidate.solution = std::move(result);
  };
  // The start may have been a millimetre off and its voxels with it.
  adopt(fit_globe(problem, prepare(globe), eye.evidence, globe.fields));
  adopt(fit_cornea(problem, prepare(front), eye.evidence, candidate.apex_costs));
  set_final_loss(problem, eye.evidence);
  adopt(fit_whole_eye(problem, prepare({}), eye.evidence));
  return problem;
}

/// That the coil's profile is smooth counts once the globe is in its place: on the way there it must bend.
Priors with_smooth_coil(Priors priors, const ForwardModel& model) {
  const ParameterLayout& layout = model.layout();
  for (int s = 0; s < layout.stacks; ++s)
    priors.sigma.segment(layout.stack(s) + coil_second_order, coil_count - coil_second_order)
        .setConstant(model.stacks()[s].coil_curvature_sigma);
  return priors;
}

/// Standard deviations of a globe's length and semi-axes where the length is off by that much, and each diameter too.
VectorXd globe_sigmas(const EyeFit& fit, double length_sigma_mm) {
  VectorXd sigma = VectorXd::Zero(static_cast<Eigen::Index>(fit.active.size()));
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    const int parameter = fit.active[static_cast<std::size_t>(i)];
    if (parameter == axial_length) sigma[i] = length_sigma_mm;
    if (parameter >= globe_x && parameter <= globe_z) sigma[i] = length_sigma_mm / 2;
  }
  return sigma;
}

/// What differs between the axes of the error below, as a share of it: without it the retina's radii and asphericity of
/// 16 eyes were covered to 81 % (docs/evidence/worlds.md).
constexpr double unlike_along_axes = 2.0 / 3;

/// What a person's eyes err by alike in images of one contrast: the wall's layers, which move length and diameters together.
Eigen::MatrixXd error_of_layers(const EyeFit& fit) {
  const VectorXd together = globe_sigmas(fit, error_of_layers_mm(fit)), apart = unlike_along_axes * together;
  return together * together.transpose() + Eigen::MatrixXd(apart.cwiseAbs2().asDiagonal());
}

/// And in images of any: the lens's nucleus, which is drawn as 0.62 of its thickness; one of 0.4 to 0.8 moves that thickness
/// by 0.03 mm (rms; docs/evidence/worlds.md).
Eigen::MatrixXd error_of_nucleus(const EyeFit& fit) {
  constexpr double of_nucleus_mm = 0.03;
  VectorXd sigmas = VectorXd::Zero(static_cast<Eigen::Index>(fit.active.size()));
  for (Eigen::Index i = 0; i < sigmas.size(); ++i)
    if (fit.active[static_cast<std::size_t>(i)] == lens_thickness) sigmas[i] = of_nucleus_mm;
  return sigmas.cwiseAbs2().asDiagonal();
}

/// What a globe's length and diameters may be off by besides where the image is not what the model has: the share of the
/// residuals that noise does not explain, times what fits of real heads differ by from independent readings, and
/// of one person in T1 and T2 (docs/evidence/real-scans.md). And the radius at which a lens ends, which is drawn as a sharp
/// rim and is a round one: rms of what it errs by in phantoms (docs/evidence/accuracy.md). And in T2, where pixels do not
/// show the wall's layers, the globe's semi-axis along the eye's: filters and echo trains, which differ between an image's
/// axes, move the retina's asphericity by 0.03 (rms of 48 eyes of `scanner`; docs/evidence/worlds.md) and leave corneas 0.5 D
/// too steep (mean of 57); how thick those are nobody sees (hides_thickness()). In finer T2 corneas are 0.01 mm off beside
/// their noise (`orbit`, 92 by the surface coil).
Eigen::MatrixXd model_error(const EyeFit& fit) {
  constexpr double of_unexplained_mm = 0.3, round_rim_mm = 0.24, of_echo_train_mm = 0.12,
                   of_corneal_power_D = 0.5, of_blurred_thickness_mm = 0.025, of_resolved_thickness_mm = 0.01;
  const bool is_coarse = fit.weighting == Weighting::t2 && error_of_layers_mm(fit) > 0;
  VectorXd sigmas = globe_sigmas(fit, of_unexplained_mm * (1 - 1 / std::max(1.0, fit.chi2_per_voxel)));
  for (Eigen::Index i = 0; i < sigmas.size(); ++i) {
    const int parameter = fit.active[static_cast<std::size_t>(i)];
    if (parameter == lens_equator_radius) sigmas[i] = round_rim_mm;
    if (parameter == anterior_chamber_depth) sigmas[i] = error_of_chamber_mm(fit);
    if (parameter == cornea_thickness && fit.weighting == Weighting::t2 &&
        !hides_thickness(fit.weighting, fit.evidence, fit.stacks))
      sigmas[i] = is_coarse ? of_blurred_thickness_mm : of_resolved_thickness_mm;
    if (!is_coarse) continue;
    if (parameter == globe_z) sigmas[i] = std::hypot(sigmas[i], of_echo_train_mm);
    if (parameter == cornea_c) sigmas[i] = of_corneal_power_D * per_mm_of_keratometric_D;
  }
  return sigmas.cwiseAbs2().asDiagonal();
}

/// What an eye whose cornea is as thick as a prior says may be off by for it, the other parameters with it as far as the
/// images tie them to the thickness.
/// \param of_solution  with the thickness held
Eigen::MatrixXd error_of_held_thickness(const EyeFit& fit, const Eigen::MatrixXd& of_solution) {
  const auto found = std::find(fit.active.begin(), fit.active.end(), cornea_thickness);
  if (found == fit.active.end()) return Eigen::MatrixXd::Zero(of_solution.rows(), of_solution.cols());
  const auto at = found - fit.active.begin();
  const VectorXd with_thickness = of_solution.col(at) / of_solution(at, at);
  const double prior_mm = fit.priors.sigma[cornea_thickness];
  return (prior_mm * prior_mm - of_solution(at, at)) * with_thickness * with_thickness.transpose();
}

/// The covariance at the fit's solution, widened by what noise does not explain.
void estimate_covariance(EyeFit& fit, const FitProblem& problem, const Basis& basis) {
  const Eigen::MatrixXd of_solution = fit.covariance = covariance(problem, fit.parameters, basis);
  fit.covariance = widened_for_coherent_residuals(fit, problem);
  fit.covariance = widened_for_faint_wall(fit);
  if (fit.evidence == Evidence::intensities) {
    const DisplacedSlices displaced = displaced_slices(fit, problem, of_solution);
    fit.slice_displacement_mm = displaced.rms_mm;
    fit.covariance += displaced.covariance;
    fit.common_covariance = error_of_nucleus(fit);
    fit.shared_covariance = error_of_layers(fit) + fit.common_covariance;
    fit.covariance += model_error(fit) + fit.shared_covariance;
    if (hides_thickness(fit.weighting, fit.evidence, fit.stacks))
      fit.covariance += error_of_held_thickness(fit, of_solution);
  }
}

/// The last passes: everything that is active, then once more with weights that know the misfit. Samples,
/// covariance and judgement go into the fit.
/// \param step_done  called after each
void fit_to_all_voxels(EyeFit& fit, const std::function<void()>& step_done) {
  FitProblem problem;
  problem.model = &fit.model;
  problem.priors = held_where_unseen(fit.priors, fit.weighting, fit.evidence, fit.stacks);
  set_final_loss(problem, fit.evidence);
  const Basis basis = select_parameters(fit.layout.size(), fit.active),
              along_head = select_along_head(fit.model, fit.active);
  const bool faint_wall = fit.weighting == Weighting::t1 && fit.evidence == Evidence::intensities;
  const auto pass = [&](const SolveLimits& stop) {
    if (faint_wall) add_curved_edges(problem.samples, fit.model, fit.parameters, fit.stacks);
    SolveResult result = solve(problem, fit.parameters, along_head, stop);
    fit.parameters = std::move(result.parameters);
    fit.iterations += result.iterations;
    fit.converged = result.converged;
  };
  // On the way here the globe needs every voxel that holds it.
  Selection last;
  last.optic_nerve = false;
  problem.samples = select_samples(fit.model, fit.parameters, fit.stacks, last);
  check_voxels(problem.samples, fit.stacks, fit.evidence);
  fit.misfit = freeze_deviations(problem, fit.parameters);
  // Curved edges are those of the eye so far: after the third pass the globe moves by less than 0.01 mm.
  for (int i = 0; i < (faint_wall ? 3 : 1); ++i) pass({25});
  if (step_done) step_done();

  // The balance of image and priors, and the covariance, with weights that know about the misfit.
  const std::array<double, part_count> widening = judge_residuals(fit, problem);
  std::vector<float> deviations;
  for (Sample& sample : problem.samples) {
    deviations.push_back(sample.deviation);
    sample.deviation *= static_cast<float>(std::sqrt(widening[static_cast<std::size_t>(sample.part)]));
  }
  // Closer than intervals need: where a fit stops on the way depends on where it began.
  pass({100, 1e-9});
  if (step_done) step_done();
  estimate_covariance(fit, problem, basis);
  // Labels are no smooth surface: what they depart from a biconic is how they were drawn.
  if (!fit.layout.irregular_cornea && fit.evidence == Evidence::intensities && !fit.front_is_blanked())
    fit.irregularity = corneal_irregularity(problem, fit.parameters, fit.active);
  for (std::size_t i = 0; i < deviations.size(); ++i) problem.samples[i].deviation = deviations[i];
  judge_residuals(fit, problem);
  fit.samples = std::move(problem.samples);
}

/// Frees the cornea's form, for another fit.
void make_cornea_irregular(EyeFit& fit) {
  fit.model = fit.model.with_irregular_cornea();
  fit.layout = fit.model.layout();
  fit.parameters = with_free_form(fit.parameters, fit.layout);
  for (int i = fit.layout.corneal_form(); i < fit.layout.size(); ++i) fit.active.push_back(i);
  fit.priors = irregular_cornea_priors(fit.priors, fit.layout);
  fit.turned_by = {};  // the eye is fitted again, along the patient's axes
}

}  // namespace

double EyeFit::sigma(int parameter) const {
  const auto at = std::find(active.begin(), active.end(), parameter);
  if (at == active.end()) return priors.sigma[parameter] < unknown_sigma ? priors.sigma[parameter] : 0;
  const auto i = at - active.begin();
  return std::sqrt(covariance(i, i));
}

double EyeFit::pole_depth_sigma_mm() const {
  const VectorXd derivatives = distance_derivatives(*this).col(pole_depth);
  return std::sqrt(std::max(0.0, derivatives.dot(covariance * derivatives)));
}

ViewEdges read_edges_of(const FoundEye& eye, const std::vector<const Stack*>& stacks) {
  ViewEdges edges;
  for (const EyeView& view : eye.views)
    edges.push_back(read_eye(*stacks[view.stack], {view.globe.centre, eye.axis}, eye.weighting));
  return edges;
}

namespace {

/// Where the finder saw the eye, or its edges where they are given.
EyeStart start_at(const FoundEye& eye, const ViewEdges& edges, std::optional<double> age_years) {
  EyeStart start;
  start.age_years = age_years;
  start.laterality = eye.laterality;
  start.globe_centre = eye.views.front().globe.centre;
  start.globe_radius_mm = eye.radius_mm;
  start.axis = eye.axis;
  start.other_axis = eye.other_axis;
  const auto centre_in = [&](std::size_t v) {
    return v < edges.size() && edges[v] ? edges[v]->reading.globe.centre : eye.views[v].globe.centre;
  };
  start.globe_centre = centre_in(0);
  for (std::size_t v = 0; v < eye.views.size(); ++v)
    start.stack_shift.push_back(start.globe_centre - centre_in(v));
  if (edges.empty() || !edges.front()) return start;
  const EdgeReading& read = edges.front()->reading;
  start.axis = read.globe.axes.col(2);
  start.other_axis.reset();
  start.globe_half_axes_mm = read.half_axes_along_voxels_mm;
  if (read.axial) start.apex_distance_mm = apex_distance_mm(*read.axial);
  return start;
}

}  // namespace

EyeStart start_of(const FoundEye& eye, const ViewEdges& edges, std::optional<double> age_years) {
  EyeStart start = start_at(eye, edges, age_years);
  // In T1 an edge may be the wall's or that of displaced fat: a sphere about the same place too.
  if (start.globe_half_axes_mm && eye.weighting == Weighting::t1) {
    EyeStart sphere = start;
    sphere.globe_radius_mm = start.globe_half_axes_mm->mean();
    sphere.globe_half_axes_mm.reset();
    sphere.apex_distance_mm.reset();
    start.others.push_back(std::move(sphere));
  }
  return start;
}

std::vector<const Stack*> views_of(const FoundEye& eye, const std::vector<const Stack*>& stacks) {
  std::vector<const Stack*> views;
  for (const EyeView& view : eye.views) views.push_back(stacks[view.stack]);
  return views;
}

EyeFit fit_eye(const std::vector<const Stack*>& stacks, const EyeStart& start, Weighting weighting,
               const std::function<void()>& advance, Evidence evidence) {
  const auto step_done = [&] {
    if (advance) advance();
  };
  const ImagedEye eye = imaged_eye(stacks, start, weighting, evidence);
  std::vector<Candidate> candidates =
      globe_candidates(eye, globe_starts(eye.model, stacks, start, weighting, evidence));
  if (candidates.empty())
    throw no_result_error(fmt::format("too few voxels show the eye: a fit needs {}", fewest_voxels));
  step_done();
  for (Candidate& candidate : candidates) {
    FitProblem solved = complete(candidate, eye);
    if (candidates.size() > 1) note_residuals(candidate, std::move(solved), eye.stacks);
  }
  const Candidate& best = most_likely(candidates, eye.model);
  step_done();

  EyeFit fit{eye.model.layout(), weighting, eye.stacks, eye.model};
  fit.evidence = evidence;
  fit.parameters = best.solution.parameters;
  fit.active = free_parameters(eye.model, evidence);
  fit.priors = with_smooth_coil(best.priors, eye.model);
  const Priors of_population = priors_about(eye, fit.parameters);
  fit.priors.mean[anterior_chamber_depth] = of_population.mean[anterior_chamber_depth];
  fit.priors.sigma[anterior_chamber_depth] = of_population.sigma[anterior_chamber_depth];
  fit.iterations = best.solution.iterations;
  fit.start_costs = best.apex_costs;
  fit_to_all_voxels(fit, step_done);
  fit.half_axes_along_voxels_mm = fit.parameters.segment<3>(globe_x);
  fit = along_patient(std::move(fit));
  if (fit.irregularity.found() && finest_pixel_mm(fit.stacks) <= CornealIrregularity::coarsest_pixel_mm &&
      fit.slice_displacement_mm <= CornealIrregularity::most_displaced_mm) {
    make_cornea_irregular(fit);
    fit_to_all_voxels(fit, {});
  }
  return fit;
}

std::string alike_images(const EyeFit& fit) {
  return std::string(to_string(fit.weighting)) + images_of_layers(fit);
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
    if (prior < unknown_sigma) eye.prior_sigma[name] = prior;
    const double left = std::min(1.0, fit.sigma(fit.active[i]) / prior);
    eye.source[name] = Origin::of_images(measured, 1 - left * left).source;
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  eye.covariance.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) eye.covariance(i, j) = fit.covariance(rows[i], rows[j]);
  eye.iris_diameter_mm = 2 * fit.value(pupil_radius);
  return eye;
}

}  // namespace emmetrope::segmentation
