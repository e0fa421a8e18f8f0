#include "segmentation/fit/observation.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"
#include "segmentation/fit/rician.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using Eigen::VectorXd;

/// Radius of a sphere that holds vitreous only, about a point a little behind the globe's centre.
constexpr double vitreous_core_mm = 6.5;
Vector3d vitreous_core(const EyeStart& start) { return start.globe_centre - 2.0 * start.axis; }

/// Sub-slices so that a cornea's curvature within one is below a hundredth of a millimetre.
int subslices_for(double thickness_mm) {
  return std::clamp(static_cast<int>(std::ceil(thickness_mm / 0.7)), 1, 4);
}

/// Spread of the coil's second-order coefficients (of 12 mm squared) before the images are seen. A loop of
/// radius R has the sensitivity (1 + d^2 / R^2)^(-3/2) at a distance d on its axis; the second order of its
/// logarithm is 0.12 to 0.18 for an eye's coil (R 25 to 35 mm, d 12 mm), and 0.015 to 0.04 for an element of
/// a head coil (R 50 to 70 mm, d 25 to 40 mm), which a stack that shows both eyes was made with.
double coil_curvature_sigma(const Stack& stack) {
  return (stack.extent_mm > 0 ? stack.extent_mm : whole_extent_mm(stack)) > 90 ? 0.1 : 0.2;
}

/// The optic nerve with its sheath, 5 mm thick, leaves the globe 15 degrees nasally of the pole. In T1 it is
/// as dark as the wall, and its sheath as the vitreous, where fat is expected; voxels this near to it say
/// nothing of the wall.
constexpr double optic_nerve_nasal_deg = 15, optic_nerve_reach_deg = 14;
Vector3d optic_nerve(Laterality laterality) {
  const double nasal = (laterality == Laterality::od ? 1 : -1) * optic_nerve_nasal_deg * degree;
  return {std::sin(nasal), 0, -std::cos(nasal)};
}

/// A voxel shows cornea, chamber and lid only, where its middle lies this near to the axis, or where its rim,
/// and a pixel of blur, lie before the limbus (5.85 +- 0.21 mm, Rufer et al. 2005; 5 % of the corneas are
/// smaller).
constexpr double front_reach_mm = 4.6, least_limbus_mm = 5.5;

/// Where in the eye frame (y) the fissure between closed lids begins at the highest.
constexpr double fissure_top_mm = -2.6;

// One voxel in so many is chosen by its place from the globe's middle, not by where the file began; on either side of it
// alike, as in a mirrored file.
bool is_every(int stride, const Vector3i& from_middle) {
  return from_middle.cwiseAbs().dot(Vector3i(1, 2, 3)) % stride == 0;
}
bool all_even(const Vector3i& from_middle) {
  return std::all_of(from_middle.begin(), from_middle.end(), [](int i) { return i % 2 == 0; });
}
Vector3i nearest_voxel(const Stack& stack, const Vector3d& lps) {
  const Vector3d from_first = lps - stack.slice_position.front();
  // By the slices' own places, as one may be missing.
  const auto nearest = std::min_element(
      stack.slice_position.begin(), stack.slice_position.end(), [&](const Vector3d& a, const Vector3d& b) {
        return std::abs((a - lps).dot(stack.normal)) < std::abs((b - lps).dot(stack.normal));
      });
  return {static_cast<int>(std::lround(from_first.dot(stack.along_row) / stack.column_spacing_mm)),
          static_cast<int>(std::lround(from_first.dot(stack.along_column) / stack.row_spacing_mm)),
          static_cast<int>(nearest - stack.slice_position.begin())};
}

/// Which voxels of one stack a pass uses, and what matters to each.
class VoxelSelector {
 public:
  VoxelSelector(const ForwardModel::AtParameters& at, const VectorXd& a, const ObservedStack& observed,
                std::size_t index, const Selection& selection)
      : at_(at),
        observed_(observed),
        index_(index),
        selection_(selection),
        pixel_(std::max(observed.stack->column_spacing_mm, observed.stack->row_spacing_mm)),
        edge_reach_(std::max(2.0, 2.5 * pixel_)),
        outside_reach_(std::max(selection.outside_mm, 0.6 * pixel_)),
        influence_(std::max(2.5, 5 * pixel_) + 0.5),
        lens_begin_(a[anterior_chamber_depth]),
        mid_lens_(a[anterior_chamber_depth] + a[lens_thickness] / 2),
        lens_end_(a[anterior_chamber_depth] + a[lens_thickness]),
        equator_depth_(a[axial_length] - a[globe_z]),
        through_(at.to_eye(observed.stack->normal * (observed.sampling.thickness_mm / 2),
                           static_cast<int>(index)) -
                 at.to_eye(Vector3d::Zero(), static_cast<int>(index))) {}

  double equator_depth() const { return equator_depth_; }

  /// A voxel without its value, where the pass uses it.
  /// \param from_middle  its column, row and slice from the voxel in the globe's middle
  std::optional<Sample> select(const Vector3d& position, const Vector3i& from_middle) const {
    if (!is_every(selection_.stride, from_middle)) return std::nullopt;
    const Vector3d p = at_.to_eye(position, static_cast<int>(index_));
    Sample sample;
    sample.zone = -p.z() < mid_lens_ ? Zone::front : Zone::rear;
    const bool used =
        sample.zone == Zone::front ? select_front(p, sample) : select_rear(p, from_middle, sample);
    if (!used) return std::nullopt;
    sample.position = position;
    sample.deviation = static_cast<float>(observed_.sampling.noise);
    sample.stack = static_cast<std::uint8_t>(index_);
    return sample;
  }

 private:
  /// Distance of the farthest part of the voxel from the axis.
  double off_axis_reach(const Vector3d& p) const {
    return std::max((p + through_).head<2>().norm(), (p - through_).head<2>().norm());
  }

  bool select_front(const Vector3d& p, Sample& sample) const {
    const double depth = -p.z(), off_axis = p.head<2>().norm(), reach = off_axis_reach(p);
    if (off_axis > front_reach_mm && reach + pixel_ > least_limbus_mm) return false;
    const auto d = at_.distances(p);
    if (d.lid < -edge_reach_ || d.cornea_front < -5) return false;
    sample.near_cornea = d.cornea_back < influence_;
    sample.near_lens = depth > lens_begin_ - influence_;
    if (!selection_.cornea && d.cornea_back < 0.5 + pixel_) return false;
    // The root of the iris and the lens' rounded edge are not modelled.
    if (reach > 3.4 && (d.iris > -1 || depth > lens_begin_ - 0.5)) return false;
    // Nor is the fissure between the lids, a few millimetres below the apex.
    const double lowest = p.y() - std::abs(through_.y()) - pixel_;
    const double foremost = d.cornea_front - std::abs(through_.z());
    if (lowest < fissure_top_mm && foremost < -0.6) return false;
    sample.part = d.cornea_front < -0.6              ? Part::lid
                  : d.cornea_back < 0.5 + pixel_     ? Part::cornea
                  : depth > lens_begin_ - 1 - pixel_ ? Part::lens
                                                     : Part::vitreous;
    return true;
  }

  bool select_rear(const Vector3d& p, const Vector3i& from_middle, Sample& sample) const {
    if (!selection_.rear) return false;
    const double depth = -p.z();
    if (off_axis_reach(p) > 3.4 && depth < lens_end_ + 1.5) return false;  // lens edge, zonule, ciliary body
    const auto d = at_.distances(p);
    if (d.outer < -outside_reach_) return false;
    if (d.globe < edge_reach_ + 1 && depth < equator_depth_ - 2) return false;  // ciliary body, tendons, lids
    if (!selection_.optic_nerve && observed_.optic_nerve && d.globe < edge_reach_ &&
        d.direction.dot(*observed_.optic_nerve) > std::cos(optic_nerve_reach_deg * degree))
      return false;
    sample.near_lens = depth < lens_end_ + influence_ && p.head<2>().norm() < 5;
    sample.near_wall = d.globe < influence_;
    // Pure vitreous says little: one voxel in eight.
    if (d.globe > edge_reach_ && depth > lens_end_ + edge_reach_ && !all_even(from_middle)) return false;
    sample.part = d.outer < 0.3           ? Part::surroundings
                  : d.globe < edge_reach_ ? Part::wall
                  : d.lens > -1 - pixel_  ? Part::lens
                                          : Part::vitreous;
    if (sample.near_wall && selection_.fields) {
      for (std::size_t i = 0; i < bumps_.size(); ++i)
        if (bumps_[i].dot(d.direction) > bump_reach_) sample.bumps.push_back(static_cast<std::uint8_t>(i));
    }
    return true;
  }

  const ForwardModel::AtParameters& at_;
  const ObservedStack& observed_;
  std::size_t index_;
  const Selection& selection_;
  double pixel_, edge_reach_, outside_reach_;
  double influence_;  ///< of a surface on a voxel
  double lens_begin_, mid_lens_, lens_end_, equator_depth_;
  Vector3d through_;  ///< half the slice's thickness, in the eye frame
  std::vector<Vector3d> bumps_ = bump_directions();
  /// Three widths and a bit: a neighbour's Gaussian has fallen to 0.6 %.
  double bump_reach_ = std::cos(3.2 * bump_width_rad);
};

/// As far as the fit looks.
BlankedRegion blanked_about(const Stack& stack, const EyeStart& start) {
  constexpr double reach_mm = 26;
  return blanked_front(stack, start.globe_centre, start.axis, reach_mm);
}

/// What only a scanner's image has: levels, noise, coil, chemical shift.
void observe_intensities(ObservedStack& o, const EyeStart& start, Weighting weighting) {
  const Stack& stack = *o.stack;
  const TissueLevels levels = tissue_levels(stack, start, weighting);
  o.reference = levels.reference(weighting);
  o.fat_is_dark = weighting == Weighting::t1 && levels.fat_is_dark();
  // Positive where an image is masked to zero around the globe too: the model divides by it.
  o.sampling.fat = std::max(levels.fat / o.reference, 1e-3);
  // In T2 choroid and retina are brighter than muscle, the sclera is darker; in T1 muscle is as bright as both together.
  constexpr double under_wall_t2 = 0.25;
  o.sampling.muscle_under_wall = weighting == Weighting::t2 ? under_wall_t2 : 0;
  if (!(o.reference > 0)) throw no_result_error(stack.name + ": no signal where the eye should be");
  o.sampling.thickness_mm =
      stack.slice_thickness_mm > 0 ? stack.slice_thickness_mm : stack.slice_spacing_mm();
  if (weighting == Weighting::t1 && start.laterality) o.optic_nerve = optic_nerve(*start.laterality);
  if (stack.slices_are_encoded)
    o.sampling.slice_cutoff_per_mm = 0.5 / std::max(o.sampling.thickness_mm, stack.slice_spacing_mm());
  o.sampling.coil_curvature_sigma = coil_curvature_sigma(stack);
  // What is dark covers nothing.
  if (!o.fat_is_dark) o.sampling.fat_shift_sigma_mm = stack.fat_shift_sigma_mm;
  o.sampling.noise = vitreous_noise(stack, start, o.left_out) / o.reference;
  o.blanked = blanked_about(stack, start);
  o.front_is_blanked = o.blanked.holds_front(stack, start.globe_centre, start.axis);
}

}  // namespace

double label_deviation(const Stack& stack) {
  const double pixel = std::max(stack.column_spacing_mm, stack.row_spacing_mm);
  return std::sqrt(std::max(pixel, stack.slice_spacing_mm()) / pixel / 12);
}

bool front_is_blanked(const std::vector<ObservedStack>& stacks) {
  return !stacks.empty() &&
         std::all_of(stacks.begin(), stacks.end(), [](const ObservedStack& o) { return o.front_is_blanked; });
}

bool fat_is_dark(const std::vector<ObservedStack>& stacks) {
  return std::any_of(stacks.begin(), stacks.end(), [](const ObservedStack& o) { return o.fat_is_dark; });
}

double finest_pixel_mm(const std::vector<ObservedStack>& stacks) {
  double finest = std::numeric_limits<double>::infinity();
  for (const ObservedStack& o : stacks)
    finest = std::min(finest, std::max(o.stack->row_spacing_mm, o.stack->column_spacing_mm));
  return finest;
}

TissueLevels tissue_levels(const Stack& stack, const EyeStart& start, Weighting weighting) {
  const BlankedRegion blanked = blanked_about(stack, start);
  std::vector<double> vitreous_values, wall_values, lens_values, lid_values, air_values, surround_values;
  for_each_voxel_near(stack, start.globe_centre, 24, [&](int c, int r, int s, const Vector3d& x) {
    const double value = stack.at(c, r, s);
    if (blanked.holds_voxel(c, r, s)) return;
    const Vector3d from_centre = x - start.globe_centre;
    const double distance = from_centre.norm(), along = from_centre.dot(start.axis);
    const double off_axis = std::sqrt(std::max(distance * distance - along * along, 0.0));
    if ((x - vitreous_core(start)).norm() < vitreous_core_mm) vitreous_values.push_back(value);
    if (along < 0.3 * distance) {
      const double outside = distance - start.globe_radius_mm;
      if (outside > 0.2 && outside < 0.9) wall_values.push_back(value);
      if (outside > 1.8 && outside < 3.5) surround_values.push_back(value);
    }
    if (std::abs(along - 7.2) < 1.2 && off_axis < 2.5) lens_values.push_back(value);
    if (along > 13.2 && along < 14.8 && off_axis < 3) lid_values.push_back(value);
    if (along > 17) air_values.push_back(value);
  });
  const bool t2 = weighting == Weighting::t2;
  TissueLevels levels;
  levels.vitreous = quantile(vitreous_values, 0.5);
  levels.surround = quantile(surround_values, 0.5);
  levels.fat = quantile(surround_values, 0.95);
  levels.wall = quantile(wall_values, t2 ? 0.2 : 0.5);
  levels.lens = quantile(lens_values, t2 ? 0.3 : 0.6);
  levels.lid = quantile(lid_values, 0.5);
  levels.air = quantile(air_values, 0.1);
  return levels;
}

double TissueLevels::reference(Weighting weighting) const {
  return weighting == Weighting::t2 ? vitreous : std::max(surround, wall);
}

double vitreous_noise(const Stack& stack, const EyeStart& start, const VoxelMask& left_out) {
  std::vector<std::vector<std::pair<Vector3d, double>>> slices(stack.slices());
  for_each_voxel_near(stack, vitreous_core(start), vitreous_core_mm,
                      [&](int c, int r, int s, const Vector3d& x) {
                        if (left_out.holds(c, r, s)) return;
                        const Vector3d d = x - start.globe_centre;
                        slices[s].emplace_back(
                            Vector3d(d.dot(stack.along_row), d.dot(stack.along_column), 1) / vitreous_core_mm,
                            stack.at(c, r, s));
                      });
  double sum = 0, mean = 0;
  int freedom = 0, count = 0;
  for (const auto& voxels : slices) {
    const int n = static_cast<int>(voxels.size());
    if (n < 20) continue;
    Eigen::MatrixXd basis(n, 6);
    VectorXd value(n);
    for (int i = 0; i < n; ++i) {
      const double u = voxels[i].first.x(), v = voxels[i].first.y();
      basis.row(i) << 1, u, v, u * u, u * v, v * v;
      value[i] = voxels[i].second;
    }
    const VectorXd fitted = basis * basis.colPivHouseholderQr().solve(value);
    sum += (value - fitted).squaredNorm();
    freedom += n - 6;
    mean += value.sum();
    count += n;
  }
  if (freedom < 60) throw no_result_error("too few voxels in the vitreous to measure the noise");
  const double deviation = std::max(std::sqrt(sum / freedom), 1e-9 * std::abs(mean / count) + 1e-12);
  // The magnitude's deviation is below the channel's sigma at low signal: a fixed point of the Rician
  // moments.
  double sigma = deviation;
  for (int i = 0; i < 20; ++i) sigma = deviation / rician(std::max(mean / count / sigma, 0.0)).deviation;
  return sigma;
}

std::vector<ObservedStack> observe(const std::vector<const Stack*>& stacks, const EyeStart& start,
                                   Weighting weighting, Evidence evidence) {
  std::vector<ObservedStack> observed;
  for (std::size_t k = 0; k < stacks.size(); ++k) {
    const Stack& stack = *stacks[k];
    ObservedStack o;
    o.stack = &stack;
    if (k < start.left_out.size()) o.left_out = start.left_out[k];
    o.sampling.along_row = stack.along_row;
    o.sampling.along_column = stack.along_column;
    o.sampling.normal = stack.normal;
    o.sampling.row_cutoff_per_mm = 0.5 / stack.column_spacing_mm;
    o.sampling.column_cutoff_per_mm = 0.5 / stack.row_spacing_mm;
    if (evidence == Evidence::labels) {
      o.sampling.thickness_mm = std::max(stack.column_spacing_mm, stack.row_spacing_mm);
      o.sampling.noise = label_deviation(stack);
    } else {
      observe_intensities(o, start.in_stack(k), weighting);
    }
    o.sampling.subslices = o.sampling.slice_cutoff_per_mm > 0 ? 1 : subslices_for(o.sampling.thickness_mm);
    observed.push_back(o);
  }
  return observed;
}

std::vector<Sample> select_samples(const ForwardModel& model, const VectorXd& a,
                                   const std::vector<ObservedStack>& stacks, const Selection& selection) {
  const ForwardModel::AtParameters at(model, a);
  const Vector3d axis = model.axis(a);
  std::vector<Sample> samples;
  for (std::size_t k = 0; k < stacks.size(); ++k) {
    const Vector3d apex =
        a.segment<3>(apex_x) - a.segment<3>(model.layout().stack(static_cast<int>(k)) + shift_first);
    const VoxelSelector selector(at, a, stacks[k], k, selection);
    const Vector3i middle = nearest_voxel(*stacks[k].stack, model.coil_reference());
    for_each_voxel_near(*stacks[k].stack, apex - selector.equator_depth() * axis, 19,
                        [&](int c, int r, int s, const Vector3d& x) {
                          if (stacks[k].blanked.holds_voxel(c, r, s) || stacks[k].left_out.holds(c, r, s))
                            return;
                          std::optional<Sample> sample = selector.select(x, Vector3i(c, r, s) - middle);
                          if (!sample) return;
                          sample->value =
                              static_cast<float>(stacks[k].stack->at(c, r, s) / stacks[k].reference);
                          samples.push_back(std::move(*sample));
                        });
  }
  return samples;
}

}  // namespace emmetrope::segmentation
