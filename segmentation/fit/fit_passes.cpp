#include "segmentation/fit/fit_passes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/rician.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::VectorXd;

std::vector<int> range(int first, int last) {
  std::vector<int> indices;
  for (int i = first; i <= last; ++i) indices.push_back(i);
  return indices;
}
void append(std::vector<int>& to, const std::vector<int>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

/// Those that a globe tells.
std::vector<int> stack_parameters(const ForwardModel& model) {
  const ParameterLayout& layout = model.layout();
  const std::vector<StackSampling>& stacks = model.stacks();
  std::vector<int> indices;
  for (int s = 0; s < layout.stacks; ++s) {
    const int at = layout.stack(s);
    append(indices, range(at + coil_first, at + coil_first + coil_count - 1));
    // The first stack defines gain and place.
    if (s > 0) append(indices, range(at + log_gain, at + shift_first + 2));
    indices.push_back(at + log_sharpness);
    if (stacks[static_cast<std::size_t>(s)].slice_cutoff_per_mm > 0)
      indices.push_back(at + log_sharpness_through);
    for (const int along : {0, 1})
      if (stacks[static_cast<std::size_t>(s)].fat_shift_sigma_mm[along] > 0)
        indices.push_back(at + fat_shift_first + along);
  }
  return indices;
}

/// Filter, and sharpness of rows against columns.
std::vector<int> window_parameters(const ParameterLayout& layout) {
  std::vector<int> indices;
  for (int s = 0; s < layout.stacks; ++s)
    append(indices, {layout.stack(s) + log_sharpness_ratio, layout.stack(s) + k_space_filter});
  return indices;
}

/// The head's turns against the first stack.
std::vector<int> turn_parameters(const ParameterLayout& layout) {
  std::vector<int> indices;
  for (int s = 1; s < layout.stacks; ++s)
    append(indices, range(layout.stack(s) + turn_first, layout.stack(s) + turn_first + 2));
  return indices;
}

/// Those that the evidence leaves open.
std::vector<int> open_parameters(const ParameterLayout& layout, std::vector<int> wanted, Evidence evidence) {
  if (evidence == Evidence::intensities) return wanted;
  const auto known = [&](int parameter) {
    const int in_stack = (parameter - eye_parameter_count) % stack_parameter_count;
    const bool of_stack = parameter >= eye_parameter_count && parameter < layout.displacement();
    return parameter == wall_inner_share || (parameter >= lid_thickness && parameter <= surround) ||
           parameter >= layout.background() ||
           (of_stack && (in_stack < shift_first || in_stack == log_sharpness || in_stack >= fat_shift_first));
  };
  wanted.erase(std::remove_if(wanted.begin(), wanted.end(), known), wanted.end());
  return wanted;
}

/// The direction that slides cornea and lid along the axis: the apex moves out, all that lies behind keeps
/// its place.
VectorXd apex_slide(const ForwardModel& model, const VectorXd& parameters) {
  VectorXd slide = VectorXd::Zero(parameters.size());
  slide.segment<3>(apex_x) = model.axis(parameters);
  for (const int depth : {int(axial_length), int(anterior_chamber_depth)}) slide[depth] = 1;
  return slide;
}

/// \param direction  becomes the last column
Basis select_parameters_and_direction(const std::vector<int>& active, const VectorXd& direction) {
  const auto last = static_cast<int>(active.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < last; ++i) entries.emplace_back(active[static_cast<std::size_t>(i)], i, 1);
  for (int i = 0; i < static_cast<int>(direction.size()); ++i)
    if (direction[i] != 0) entries.emplace_back(i, last, direction[i]);
  Basis basis(direction.size(), last + 1);
  basis.setFromTriplets(entries.begin(), entries.end());
  return basis;
}

bool is_cornea_fluid(const VectorXd& parameters) {
  return std::abs(parameters[cornea] - parameters[aqueous]) < std::abs(parameters[cornea] - parameters[wall]);
}

}  // namespace

Basis select_along_head(const ForwardModel& model, const std::vector<int>& active) {
  const ParameterLayout& layout = model.layout();
  Basis axes(layout.size(), layout.size());
  axes.setIdentity();
  std::vector<int> places{apex_x};
  for (int s = 1; s < layout.stacks; ++s)
    append(places, {layout.stack(s) + shift_first, layout.stack(s) + turn_first});
  for (const int place : places)
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        axes.coeffRef(place + row, place + column) = model.head_axes()(row, column);
  return axes * select_parameters(layout.size(), active);
}

VectorXd freeze_deviations(FitProblem& problem, const VectorXd& parameters) {
  const ForwardModel::AtParameters at(*problem.model, parameters);
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

std::vector<int> free_parameters(const ForwardModel& model, Evidence evidence) {
  const ParameterLayout& layout = model.layout();
  std::vector<int> indices = range(apex_x, surround);
  append(indices, stack_parameters(model));
  append(indices, window_parameters(layout));
  append(indices, turn_parameters(layout));
  append(indices, range(layout.displacement(), layout.size() - 1));
  return open_parameters(layout, indices, evidence);
}

SolveResult fit_globe(FitProblem& problem, const VectorXd& start, Evidence evidence, bool background_varies) {
  std::vector<int> active = range(apex_x, gaze_vertical);
  append(active, {anterior_chamber_depth, lens_thickness, lens_anterior_radius, lens_posterior_radius,
                  globe_x, globe_y, globe_z, wall_lateral, wall_axial, iris_offset, pupil_radius, vitreous,
                  aqueous, wall, wall_layering, lens, lens_nucleus, iris, surround});
  const ParameterLayout& layout = problem.model->layout();
  append(active, stack_parameters(*problem.model));
  const Priors kept = problem.priors;
  // Where the wall is faint against fat a wrong filter would lead to the wrong border.
  if (background_varies) {
    append(active, range(layout.background(), layout.size() - 1));
    // Nor may the wall become part of it.
    problem.priors.sigma[wall_lateral] /= 2;
    problem.priors.sigma[wall_axial] /= 2;
  } else {
    append(active, window_parameters(layout));
  }
  problem.loss_scale = 6;
  SolveResult result = solve(
      problem, start, select_along_head(*problem.model, open_parameters(layout, active, evidence)), {16});
  problem.priors = kept;
  return result;
}

SolveResult fit_cornea(FitProblem& problem, const VectorXd& start, Evidence evidence,
                       std::vector<double>& costs) {
  const std::vector<int> active =
      open_parameters(problem.model->layout(),
                      {cornea_c, lid_thickness, lid_tilt_x, lid_tilt_y, lid_xx, lid_yy, lid_xy, aqueous,
                       cornea, lid, air, iris, iris_slope, pupil_radius, lens},
                      evidence);
  const VectorXd slide = apex_slide(*problem.model, start);
  const Basis basis = select_parameters_and_direction(active, slide);

  problem.loss_scale = 3;
  const Priors kept = problem.priors;
  problem.priors.sigma[cornea] = 0.06;
  problem.priors.sigma[lid] = 0.15;
  SolveResult best;
  best.cost = std::numeric_limits<double>::infinity();
  const auto start_from = [&](double offset) {
    const VectorXd from = start + offset * slide;
    // The apex is held loosely at its start.
    problem.priors.mean.segment<3>(apex_x) = from.segment<3>(apex_x);
    problem.priors.sigma.segment<3>(apex_x).setConstant(0.4 * std::sqrt(3.0));
    SolveResult result = solve(problem, from, basis, {12});
    costs.push_back(result.cost);
    if (result.cost < best.cost) best = std::move(result);
  };
  for (const double offset : {-0.8, -0.4, 0.0, 0.4, 0.8}) start_from(offset);
  // What is as bright as the fluid behind it is no cornea: that lies further out, where it was taken for the lid.
  for (const double offset : {1.2, 1.6, 2.0})
    if (is_cornea_fluid(best.parameters)) start_from(offset);
  const double lowest = *std::min_element(costs.begin(), costs.end());
  for (double& cost : costs) cost -= lowest;
  problem.priors = kept;
  return best;
}

SolveResult fit_whole_eye(FitProblem& problem, const VectorXd& start, Evidence evidence) {
  std::vector<int> active = free_parameters(*problem.model, evidence);
  active.erase(std::remove_if(
                   active.begin(), active.end(),
                   [](int parameter) { return parameter == iris_half_thickness || parameter == iris_slope; }),
               active.end());
  return solve(problem, start, select_along_head(*problem.model, active), {20});
}

void set_final_loss(FitProblem& problem, Evidence evidence) {
  problem.loss_scale = 3;
  problem.rician = evidence == Evidence::intensities;
}

}  // namespace emmetrope::segmentation
