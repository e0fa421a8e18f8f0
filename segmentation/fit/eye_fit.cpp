#include "segmentation/fit/eye_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/rician.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Distance of the corneal apex from the globe's centre: the steepest change along the axis between aqueous
/// and lid.
double find_apex_distance(const std::vector<const Stack*>& stacks, const EyeStart& start, Contrast contrast) {
  constexpr double first = 8.8, last = 15.5, step = 0.2;
  const int count = static_cast<int>((last - first) / step) + 1;
  VectorXd profile = VectorXd::Zero(count);
  const Vector3d across = start.axis.unitOrthogonal(), other = start.axis.cross(across);
  for (int i = 0; i < count; ++i) {
    int values = 0;
    for (std::size_t k = 0; k < stacks.size(); ++k) {
      for (int ring = 0; ring < 9; ++ring) {
        const double angle = ring * 2 * pi / 8, radius = ring == 8 ? 0 : 1.0;
        const Vector3d x = start.in_stack(k).globe_centre + (first + i * step) * start.axis +
                           radius * (std::cos(angle) * across + std::sin(angle) * other);
        if (const auto value = interpolate(*stacks[k], x)) {
          profile[i] += *value;
          ++values;
        }
      }
    }
    if (values > 0) profile[i] /= values;
  }
  // From bright aqueous to dark cornea in T2, the other way round in T1.
  const double sign = contrast == Contrast::t2 ? -1 : 1;
  int best = 0;
  double steepest = 0;
  for (int i = 3; i + 3 < count; ++i) {
    const double slope = sign * (profile[i + 2] - profile[i - 2]);
    if (slope > steepest) {
      steepest = slope;
      best = i;
    }
  }
  const double population = 12.3;
  return best == 0 ? population : first + best * step + 0.55;
}

VectorXd start_parameters(const ParameterLayout& layout, const std::vector<const Stack*>& stacks,
                          const EyeStart& start, Contrast contrast) {
  VectorXd a = population_mean(layout);
  const double apex = find_apex_distance(stacks, start, contrast);
  a.segment<3>(apex_x) = start.globe_centre + apex * start.axis;
  a.segment<2>(gaze_horizontal) = gaze_deg(start.axis);
  a[globe_x] = a[globe_y] = a[globe_z] = start.globe_radius_mm;
  a[axial_length] = apex + start.globe_radius_mm;

  std::vector<TissueLevels> levels;
  for (std::size_t k = 0; k < stacks.size(); ++k)
    levels.push_back(measure_levels(*stacks[k], start.in_stack(k), contrast));
  for (std::size_t k = 1; k < start.stack_shift.size(); ++k)
    a.segment<3>(layout.stack(static_cast<int>(k)) + shift_first) = start.stack_shift[k];
  const auto relative = [&](double TissueLevels::*tissue) {
    double sum = 0;
    for (const TissueLevels& l : levels)
      sum += l.*tissue / (contrast == Contrast::t2 ? l.vitreous : l.surround);
    return sum / static_cast<double>(levels.size());
  };
  const bool t2 = contrast == Contrast::t2;
  a[vitreous] = a[aqueous] = relative(&TissueLevels::vitreous);
  a[wall] = relative(&TissueLevels::wall);
  a[lens] = relative(&TissueLevels::lens);
  a[lid] = relative(&TissueLevels::lid);
  a[surround] = relative(&TissueLevels::surround);
  a[air] = std::min(relative(&TissueLevels::air), 0.1);
  a[cornea] = t2 ? std::min(a[wall] + 0.02, 0.35) : a[wall];
  a[iris] = t2 ? std::min(a[lid], 0.35) : (a[wall] + a[surround]) / 2;
  return a;
}

void freeze_weights(FitProblem& problem, const VectorXd& a) {
  const ForwardModel::AtParameters at(*problem.model, a);
  for (Sample& sample : problem.samples) {
    const double noise = problem.model->stacks()[sample.stack].noise;
    sample.deviation =
        static_cast<float>(noise * rician(std::abs(at.intensity(sample, nullptr)) / noise).deviation);
  }
}

std::vector<int> range(int first, int last) {
  std::vector<int> indices;
  for (int i = first; i <= last; ++i) indices.push_back(i);
  return indices;
}
void append(std::vector<int>& to, const std::vector<int>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

std::vector<int> stack_parameters(const ParameterLayout& layout, bool sharpness) {
  std::vector<int> indices;
  for (int s = 0; s < layout.stacks; ++s) {
    const int at = layout.stack(s);
    append(indices, range(at + coil_first, at + coil_first + coil_count - 1));
    // The first stack defines gain and place.
    if (s > 0) append(indices, range(at + log_gain, at + shift_first + 2));
    if (sharpness) indices.push_back(at + log_sharpness);
  }
  return indices;
}

/// Everything that a full pass frees.
std::vector<int> all_parameters(const ParameterLayout& layout) {
  std::vector<int> indices = range(apex_x, surround);
  append(indices, stack_parameters(layout, true));
  append(indices, range(layout.displacement(), layout.size() - 1));
  return indices;
}

/// Pass 1: globe, lens, pose, without the cornea; the apex rides with the globe.
SolveResult fit_globe(FitProblem& problem, const VectorXd& start) {
  std::vector<int> active = range(apex_x, gaze_vertical);
  append(active, {anterior_chamber_depth, lens_thickness, lens_anterior_radius, lens_posterior_radius,
                  globe_x, globe_y, globe_z, wall_lateral, wall_axial, iris_depth, pupil_radius, vitreous,
                  aqueous, wall, lens, iris, surround});
  append(active, stack_parameters(problem.model->layout(), false));
  problem.loss_scale = 6;
  return solve(problem, start, select_parameters(problem.model->layout().size(), active), 16);
}

/// Pass 2: the front of the eye from five depths of the apex, globe and lens kept in place.
SolveResult fit_cornea(FitProblem& problem, const VectorXd& start, std::vector<double>& costs) {
  const int size = problem.model->layout().size();
  const std::vector<int> active{cornea_c, lid_thickness, lid_tilt_x, lid_tilt_y,   lid_xx,
                                lid_yy,   lid_xy,        aqueous,    cornea,       lid,
                                air,      iris,          iris_slope, pupil_radius, lens};
  // The last column slides cornea and lid along the axis: the apex moves out, all that lies behind keeps its
  // place.
  VectorXd slide = VectorXd::Zero(size);
  slide.segment<3>(apex_x) = gaze_axis(start[gaze_horizontal], start[gaze_vertical]);
  for (const int depth : {int(axial_length), int(anterior_chamber_depth), int(iris_depth)}) slide[depth] = 1;
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

/// 0: globe, 1: anterior segment, 2: vitreous.
int region_of(const Sample& sample) {
  if (sample.near_cornea || sample.near_lens || sample.zone == Zone::front) return 1;
  return sample.near_wall ? 0 : 2;
}

bool belongs_to_anterior(int parameter) {
  return (parameter >= cornea_c && parameter <= lens_equator_radius) ||
         (parameter >= iris_depth && parameter <= lid_xy) || parameter == cornea || parameter == lens ||
         parameter == iris || parameter == lid || parameter == air || parameter == aqueous;
}

/// Residuals by region, and the covariance scaled by them: what the model does not explain widens the
/// intervals of the parameters that live there.
void judge(EyeFit& fit, const FitProblem& problem, const Basis& basis) {
  const ForwardModel::AtParameters at(fit.model, fit.parameters);
  fit.regions = {{"globe"}, {"anterior segment"}, {"vitreous"}};
  double sum = 0;
  for (const Sample& sample : problem.samples) {
    const double r = residual(problem, at, sample);
    fit.residuals.push_back(r);
    RegionFit& region = fit.regions[region_of(sample)];
    ++region.voxels;
    region.chi2 += r * r;
    region.outliers += std::abs(r) > 4 ? 1 : 0;
    sum += r * r;
  }
  fit.chi2_per_voxel = sum / std::max<double>(1, static_cast<double>(problem.samples.size()));
  for (RegionFit& region : fit.regions) {
    region.chi2 /= std::max(1, region.voxels);
    region.outliers /= std::max(1, region.voxels);
  }
  fit.covariance = covariance(problem, fit.parameters, basis);
  VectorXd scale(static_cast<Eigen::Index>(fit.active.size()));
  for (std::size_t i = 0; i < fit.active.size(); ++i) {
    const double chi2 = fit.regions[belongs_to_anterior(fit.active[i]) ? 1 : 0].chi2;
    scale[static_cast<Eigen::Index>(i)] = std::sqrt(std::max(1.0, chi2));
  }
  fit.covariance = scale.asDiagonal() * fit.covariance * scale.asDiagonal();
}

}  // namespace

double EyeFit::sigma(int parameter) const {
  const auto at = std::find(active.begin(), active.end(), parameter);
  if (at == active.end()) return priors.sigma[parameter] < 1e5 ? priors.sigma[parameter] : 0;
  const auto i = at - active.begin();
  return std::sqrt(covariance(i, i));
}

EyeStart start_of(const FoundEye& eye) {
  EyeStart start;
  start.globe_centre = eye.views.front().globe.centre;
  start.globe_radius_mm = eye.radius_mm;
  start.axis = eye.axis;
  for (const EyeView& view : eye.views) start.stack_shift.push_back(start.globe_centre - view.globe.centre);
  return start;
}

std::vector<const Stack*> views_of(const FoundEye& eye, const std::vector<const Stack*>& stacks) {
  std::vector<const Stack*> views;
  for (const EyeView& view : eye.views) views.push_back(stacks[view.stack]);
  return views;
}

EyeFit fit_eye(const std::vector<const Stack*>& stacks, const EyeStart& start, Contrast contrast,
               const std::function<void()>& advance) {
  ParameterLayout layout;
  layout.stacks = static_cast<int>(stacks.size());
  layout.bumps = static_cast<int>(bump_directions().size());
  const std::vector<ObservedStack> observed = observe(stacks, start, contrast);
  std::vector<StackSampling> sampling;
  for (const ObservedStack& o : observed) sampling.push_back(o.sampling);
  ForwardModel model(layout, sampling, start.globe_centre);
  const auto step_done = [&] {
    if (advance) advance();
  };

  FitProblem problem;
  problem.model = &model;
  VectorXd a = start_parameters(layout, stacks, start, contrast);
  problem.priors = population_priors(layout, a, contrast);
  int iterations = 0;

  const auto adopt = [&](SolveResult result) {
    a = std::move(result.parameters);
    iterations += result.iterations;
    step_done();
    return result.converged;
  };

  problem.samples = select_samples(model, a, observed, {false, true});
  if (problem.samples.size() < 1000) throw no_result_error("too few voxels show the eye");
  adopt(fit_globe(problem, a));

  problem.samples = select_samples(model, a, observed, {true, false});
  std::vector<double> start_costs;
  adopt(fit_cornea(problem, a, start_costs));

  const std::vector<int> active = all_parameters(layout);
  const Basis basis = select_parameters(layout.size(), active);
  problem.loss_scale = 3;
  problem.samples = select_samples(model, a, observed, {true, true});
  adopt(solve(problem, a, basis, 8));

  problem.samples = select_samples(model, a, observed, {true, true});
  problem.rician = true;
  freeze_weights(problem, a);
  const bool converged = adopt(solve(problem, a, basis, 10));

  EyeFit fit{layout, contrast, observed,       model,     a,
             active, {},       problem.priors, {},        {},
             0,      {},       iterations,     converged, std::move(start_costs)};
  judge(fit, problem, basis);
  fit.samples = std::move(problem.samples);
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
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < fit.active.size(); ++i) {
    const std::string name = fit.layout.name(fit.active[i]);
    if (!has_parameter(eye, name)) continue;
    rows.push_back(static_cast<Eigen::Index>(i));
    eye.parameter_names.push_back(name);
    eye.set(name, fit.parameters[fit.active[i]]);
    const double prior = fit.priors.sigma[fit.active[i]];
    eye.source[name] = fit.sigma(fit.active[i]) > 0.9 * prior ? "prior" : "mri";
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  eye.covariance.resize(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) eye.covariance(i, j) = fit.covariance(rows[i], rows[j]);
  eye.iris_diameter_mm = 2 * fit.value(pupil_radius);
  return eye;
}

}  // namespace emmetrope::segmentation
