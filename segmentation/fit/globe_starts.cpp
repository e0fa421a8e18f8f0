#include "segmentation/fit/globe_starts.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Distance of the corneal apex from the globe's centre: the steepest change along the axis between aqueous
/// and lid.
double find_apex_distance(const std::vector<const Stack*>& stacks, const EyeStart& start,
                          Weighting weighting) {
  constexpr double first = 8.8, last = 15.5, step = 0.2;
  const int count = static_cast<int>((last - first) / step) + 1;
  VectorXd profile = VectorXd::Zero(count);
  const auto [across_axis, other] = across(*stacks.front(), start.axis);
  std::vector<Sampler> samplers;
  for (const Stack* stack : stacks) samplers.emplace_back(*stack);
  for (int i = 0; i < count; ++i) {
    int values = 0;
    for (std::size_t k = 0; k < stacks.size(); ++k) {
      for (int ring = 0; ring < 9; ++ring) {
        const double angle = ring * 2 * pi / 8, radius = ring == 8 ? 0 : 1.0;
        const Vector3d x = start.in_stack(k).globe_centre + (first + i * step) * start.axis +
                           radius * (std::cos(angle) * across_axis + std::sin(angle) * other);
        if (const auto value = samplers[k].interpolate(x)) {
          profile[i] += *value;
          ++values;
        }
      }
    }
    if (values > 0) profile[i] /= values;
  }
  // From bright aqueous to dark cornea in T2, the other way round in T1.
  const double sign = weighting == Weighting::t2 ? -1 : 1;
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

void set_stack_shifts(VectorXd& a, const ParameterLayout& layout, const EyeStart& start) {
  for (std::size_t k = 1; k < start.stack_shift.size(); ++k)
    a.segment<3>(layout.stack(static_cast<int>(k)) + shift_first) = start.stack_shift[k];
}

VectorXd start_parameters(const ForwardModel& model, const std::vector<const Stack*>& stacks,
                          const EyeStart& start, Weighting weighting, Evidence evidence) {
  const ParameterLayout& layout = model.layout();
  VectorXd a = population_mean(layout);
  const double apex =
      start.apex_distance_mm ? *start.apex_distance_mm : find_apex_distance(stacks, start, weighting);
  a.segment<3>(apex_x) = start.globe_centre + apex * start.axis;
  a.segment<2>(gaze_horizontal) = model.gaze_deg(start.axis);
  a.segment<3>(globe_x) = start.globe_half_axes_mm.value_or(Vector3d::Constant(start.globe_radius_mm));
  a[axial_length] = apex + a[globe_z];

  set_stack_shifts(a, layout, start);
  if (evidence == Evidence::labels) {
    a[vitreous] = a[aqueous] = fluid_level;
    a[wall] = a[cornea] = a[lens] = solid_level;
    a[iris] = iris_level;
    a[lid] = a[air] = a[surround] = outside_level;
    return a;
  }
  std::vector<TissueLevels> levels;
  for (std::size_t k = 0; k < stacks.size(); ++k)
    levels.push_back(tissue_levels(*stacks[k], start.in_stack(k), weighting));
  const auto relative = [&](double TissueLevels::*tissue) {
    double sum = 0;
    for (const TissueLevels& l : levels) sum += l.*tissue / l.reference(weighting);
    return sum / static_cast<double>(levels.size());
  };
  const bool t2 = weighting == Weighting::t2;
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

/// The fellow eye, at this one's place: sizes, tissues, sharpness and the displacement of fat.
VectorXd like_fellow(const ForwardModel& model, const EyeStart& start) {
  const ParameterLayout& layout = model.layout();
  VectorXd a = population_mean(layout);
  for (const Parameter size :
       {anterior_chamber_depth, lens_thickness, lens_anterior_radius, lens_posterior_radius, axial_length,
        globe_x, globe_y, globe_z, wall_lateral, wall_axial, iris_offset, pupil_radius, lid_thickness})
    a[size] = start.fellow[size];
  a.segment<surround - vitreous + 1>(vitreous) = start.fellow.segment<surround - vitreous + 1>(vitreous);
  a.segment<3>(apex_x) = start.globe_centre + (a[axial_length] - a[globe_z]) * start.axis;
  a.segment<2>(gaze_horizontal) = model.gaze_deg(start.axis);
  for (int s = 0; s < layout.stacks; ++s) {
    const int at = layout.stack(s);
    for (const int resolution : {log_sharpness, log_sharpness_ratio, log_sharpness_through, k_space_filter})
      a[at + resolution] = start.fellow[at + resolution];
    a.segment<2>(at + fat_shift_first) = start.fellow.segment<2>(at + fat_shift_first);
  }
  set_stack_shifts(a, layout, start);
  return a;
}

/// Moves the globe, in one stack, to where it lies if the finder saw the edge of displaced fat there.
void move_off_fat(VectorXd& a, const ForwardModel& model, int stack, const Vector2d& fat_shift_mm) {
  const StackSampling& sampling = model.stacks()[static_cast<std::size_t>(stack)];
  const Vector3d globe = -fat_shift_mm[0] * sampling.along_row - fat_shift_mm[1] * sampling.along_column;
  const ParameterLayout& layout = model.layout();
  if (stack > 0) {
    a.segment<3>(layout.stack(stack) + shift_first) -= globe;
    return;
  }
  a.segment<3>(apex_x) += globe;
  // In the other stacks it stays.
  for (int s = 1; s < layout.stacks; ++s) a.segment<3>(layout.stack(s) + shift_first) += globe;
}

/// With the fellow's sizes and with its own, where the globe was seen and, if that was the edge of displaced fat, off it.
std::vector<VectorXd> starts_beside_fellow(const ForwardModel& model, const std::vector<const Stack*>& stacks,
                                           const EyeStart& start, Weighting weighting, Evidence evidence) {
  const ParameterLayout& layout = model.layout();
  std::vector<VectorXd> starts{like_fellow(model, start),
                               start_parameters(model, stacks, start, weighting, evidence)};
  for (int s = 0; s < layout.stacks; ++s) {
    const int at = layout.stack(s) + fat_shift_first;
    starts[1].segment<2>(at) = start.fellow.segment<2>(at);
  }
  if (weighting != Weighting::t1) return starts;
  for (const VectorXd& still : std::vector<VectorXd>(starts)) {
    starts.push_back(still);
    for (int s = 0; s < layout.stacks; ++s)
      move_off_fat(starts.back(), model, s, still.segment<2>(layout.stack(s) + fat_shift_first));
  }
  return starts;
}

std::vector<VectorXd> starts_along_axis(const ForwardModel& model, const std::vector<const Stack*>& stacks,
                                        const EyeStart& start, Weighting weighting, Evidence evidence) {
  const ParameterLayout& layout = model.layout();
  if (start.fellow.size() > 0) return starts_beside_fellow(model, stacks, start, weighting, evidence);
  std::vector<VectorXd> starts{start_parameters(model, stacks, start, weighting, evidence)};
  if (weighting != Weighting::t1 || evidence == Evidence::labels) return starts;
  if (start.globe_half_axes_mm) return starts;
  EyeStart smaller = start;
  smaller.globe_radius_mm -= 1;
  starts.push_back(start_parameters(model, stacks, smaller, weighting, evidence));
  for (const VectorXd& still : std::vector<VectorXd>(starts)) {
    for (int s = 0; s < layout.stacks; ++s) {
      for (const int along : {0, 1}) {
        const double sigma = model.stacks()[s].fat_shift_sigma_mm[along];
        for (const double shift : {-sigma, sigma}) {
          if (shift == 0) continue;
          starts.push_back(still);
          VectorXd& moved = starts.back();
          moved[layout.stack(s) + fat_shift_first + along] = shift;
          move_off_fat(moved, model, s, shift * Vector2d::Unit(along));
        }
      }
    }
  }
  return starts;
}

}  // namespace

std::vector<std::vector<VectorXd>> globe_starts(const ForwardModel& model,
                                                const std::vector<const Stack*>& stacks,
                                                const EyeStart& start, Weighting weighting,
                                                Evidence evidence) {
  std::vector<std::vector<VectorXd>> starts{starts_along_axis(model, stacks, start, weighting, evidence)};
  for (const EyeStart& other : start.others)
    for (auto& along_axis : globe_starts(model, stacks, other, weighting, evidence))
      starts.push_back(std::move(along_axis));
  if (!start.other_axis || weighting != Weighting::t1 || evidence == Evidence::labels) return starts;
  EyeStart other = start;
  other.axis = *start.other_axis;
  starts.push_back(starts_along_axis(model, stacks, other, weighting, evidence));
  return starts;
}

}  // namespace emmetrope::segmentation
