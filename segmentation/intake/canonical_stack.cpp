#include "segmentation/intake/canonical_stack.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

constexpr int along_slices = 2;

/// One axis of a stack's lattice: column, row or slice index.
struct Axis {
  int of_stack = 0;  ///< 0 columns, 1 rows, 2 slices
  Vector3d direction;
  double spacing_mm = 0, fat_shift_sigma_mm = 0;
  int count = 0;

  double towards(int lps) const { return std::abs(direction[lps]); }
};

std::array<Axis, 3> axes_of(const Stack& stack) {
  return {Axis{0, stack.along_row, stack.column_spacing_mm, stack.fat_shift_sigma_mm.x(), stack.columns},
          Axis{1, stack.along_column, stack.row_spacing_mm, stack.fat_shift_sigma_mm.y(), stack.rows},
          Axis{along_slices, stack.normal, stack.slice_spacing_mm(), stack.fat_shift_sigma_through_mm,
               stack.slices()}};
}

/// Slices as thick as they are apart, evenly, and not shifted within their plane.
bool is_one_lattice(const Stack& stack) {
  constexpr double tolerance = 0.02;
  if (stack.slices() < 2) return false;
  const double spacing = stack.slice_spacing_mm();
  if (std::abs(stack.slice_thickness_mm - spacing) > tolerance * spacing) return false;
  for (int s = 0; s < stack.slices(); ++s) {
    const Vector3d expected = stack.slice_position.front() + s * spacing * stack.normal;
    if ((stack.slice_position[static_cast<std::size_t>(s)] - expected).norm() > tolerance * spacing)
      return false;
  }
  return true;
}

bool readout_is_untold(const Stack& stack) { return (stack.fat_shift_sigma_mm.array() > 0).all(); }

/// Heads are mostly acquired in sagittal slices, then in axial ones.
double usual_for_slices(const Axis& axis) { return axis.towards(0) + 0.5 * axis.towards(2); }

/// Which axis becomes that of the slices.
int slice_axis(const Stack& stack, const std::array<Axis, 3>& axes) {
  constexpr double alike = 1.02;
  if (stack.slices_are_told || !is_one_lattice(stack)) return along_slices;
  const double longest_mm = std::max({axes[0].spacing_mm, axes[1].spacing_mm, axes[2].spacing_mm});
  int best = -1;
  for (int i = 0; i < 3; ++i) {
    if (axes[i].spacing_mm * alike < longest_mm) continue;
    if (!readout_is_untold(stack) && axes[i].fat_shift_sigma_mm > 0) continue;
    if (best < 0 || usual_for_slices(axes[i]) > usual_for_slices(axes[best])) best = i;
  }
  return best < 0 ? along_slices : best;
}

/// Row, column and slice axis of the canonical order, their directions still the stack's.
std::array<Axis, 3> canonical_axes(const Stack& stack) {
  std::array<Axis, 3> axes = axes_of(stack);
  // A readout that is not told may run along the slices too, by as many pixels.
  if (readout_is_untold(stack))
    axes[along_slices].fat_shift_sigma_mm =
        axes[along_slices].spacing_mm * axes[0].fat_shift_sigma_mm / axes[0].spacing_mm;
  std::swap(axes[slice_axis(stack, axes)], axes[along_slices]);
  const bool sagittal = axes[along_slices].towards(0) > 0.7;
  const int to_row = sagittal ? 1 : 0;
  if (axes[1].towards(to_row) > axes[0].towards(to_row)) std::swap(axes[0], axes[1]);
  // Sagittal heads are read out up and down: the shorter way, from front to back, is the phase encoding's.
  if (sagittal && readout_is_untold(stack)) axes[0].fat_shift_sigma_mm = 0;
  return axes;
}

/// A run of indices along an axis of the stack, forward or backward.
struct Run {
  int first = 0, step = 1, count = 0;
  int operator[](int i) const { return first + i * step; }
};

/// \param at  index of the part's centre
Run run_around(const Axis& axis, double at, double reach_mm, bool backward) {
  const double reach = std::ceil(reach_mm / axis.spacing_mm - 1e-6);  // spacings of headers are rounded
  const int low = static_cast<int>(std::clamp(std::round(at) - reach, 0.0, axis.count - 1.0));
  const int high = static_cast<int>(std::clamp(std::round(at) + reach, 0.0, axis.count - 1.0));
  return backward ? Run{high, -1, high - low + 1} : Run{low, 1, high - low + 1};
}

/// The direction along its axis that the patient's left, back or head lies in: whichever is nearest.
bool runs_backward(const Vector3d& direction) {
  Eigen::Index nearest = 0;
  direction.cwiseAbs().maxCoeff(&nearest);
  return direction[nearest] < 0;
}

}  // namespace

Stack canonical_part(const Stack& stack, const Vector3d& centre_lps, double reach_mm) {
  const std::array<Axis, 3> axes = canonical_axes(stack);
  const std::array<bool, 2> backward{runs_backward(axes[0].direction), runs_backward(axes[1].direction)};
  Stack part;
  part.name = stack.name;
  part.along_row = backward[0] ? Vector3d(-axes[0].direction) : axes[0].direction;
  part.along_column = backward[1] ? Vector3d(-axes[1].direction) : axes[1].direction;
  part.normal = part.along_row.cross(part.along_column);
  part.column_spacing_mm = axes[0].spacing_mm;
  part.row_spacing_mm = axes[1].spacing_mm;
  part.slice_thickness_mm = axes[2].of_stack == along_slices ? stack.slice_thickness_mm : axes[2].spacing_mm;
  part.fat_shift_sigma_mm = {axes[0].fat_shift_sigma_mm, axes[1].fat_shift_sigma_mm};
  part.slices_are_told = stack.slices_are_told;
  part.slices_are_encoded = stack.slices_are_encoded;
  part.told_weighting = stack.told_weighting;
  part.extent_mm = stack.extent_mm > 0 ? stack.extent_mm : whole_extent_mm(stack);

  std::array<Run, 3> run;  // by the canonical axes
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3d origin = stack.slice_position.front();
    const double at = (centre_lps - origin).dot(axes[i].direction) / axes[i].spacing_mm;
    const bool is_backward = i < 2 ? backward[i] : part.normal.dot(axes[2].direction) < 0;
    // Of slices that are not evenly apart no index is told by a place: all are kept.
    run[i] = i < 2 || is_one_lattice(stack) ? run_around(axes[i], at, reach_mm, is_backward)
             : is_backward                  ? Run{axes[i].count - 1, -1, axes[i].count}
                                            : Run{0, 1, axes[i].count};
  }
  part.columns = run[0].count;
  part.rows = run[1].count;
  std::array<int, 3> index{};  // column, row, slice of the stack
  int& column = index[axes[0].of_stack];
  int& row = index[axes[1].of_stack];
  int& slice = index[axes[2].of_stack];
  for (int k = 0; k < run[2].count; ++k) {
    slice = run[2][k];
    column = run[0].first;
    row = run[1].first;
    part.slice_position.push_back(stack.position(index[0], index[1], index[2]));
    std::vector<float>& values = part.slice_intensity.emplace_back();
    values.reserve(static_cast<std::size_t>(part.rows) * part.columns);
    for (int r = 0; r < part.rows; ++r) {
      row = run[1][r];
      for (int c = 0; c < part.columns; ++c) {
        column = run[0][c];
        values.push_back(stack.at(index[0], index[1], index[2]));
      }
    }
  }
  return part;
}

}  // namespace emmetrope::segmentation
