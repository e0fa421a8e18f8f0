#include "segmentation/fit/intraocular_mass.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Volume times difference from the vitreous in steps. Ghosts in real heads whose fit stands have up to 9.4, the part of a
/// tumour of 4.3 mm radius that is 2 mm from the wall and behind the lens 16.
constexpr double least_signal_mm3 = 12;
constexpr double about_piece_mm = 2.5;  ///< what is mixed with it, and the wall that it stands on

/// By column, row and slice: how much brighter than vitreous, in steps.
using Foreign = std::map<std::array<int, 3>, double>;

/// What of a stack lies in the vitreous and is none.
/// \param known  is left out
Foreign foreign_voxels(const EyeFit& fit, std::size_t k, const Stack& stack, const VoxelMask& known) {
  constexpr double least_share_of_step = 0.3, least_noise_sigmas = 3, behind_lens_mm = 2.5;
  const double half_diagonal_mm =
      Vector3d(stack.column_spacing_mm, stack.row_spacing_mm, stack.slice_spacing_mm()).norm() / 2;
  const double inside_wall_mm = std::max(2.0, 1 + half_diagonal_mm);
  const double step =
      fit.weighting == Weighting::t2 ? fit.value(vitreous) : fit.value(surround) - fit.value(vitreous);
  const double first_depth_mm =
      fit.value(anterior_chamber_depth) + fit.value(lens_thickness) + behind_lens_mm;
  const int index = static_cast<int>(k);
  const Vector3d centre =
      fit.globe_centre_lps() - fit.parameters.segment<3>(fit.layout.stack(index) + shift_first);
  const Vector3d half_axes_mm(fit.value(globe_x), fit.value(globe_y), fit.value(globe_z));
  const Vector3d centre_in_eye(0, 0, fit.value(globe_z) - fit.value(axial_length));
  const ForwardModel::AtParameters at(fit.model, fit.parameters);
  Foreign foreign;
  for_each_voxel_near(
      stack, centre, half_axes_mm.maxCoeff(), [&](int c, int r, int s, const Vector3d& position) {
        const Vector3d p = at.to_eye(position, index);
        // Of the ellipsoid: a wall that was drawn to a mass is dented by it.
        const double radius_mm = (p - centre_in_eye).norm();
        const double wall_mm = radius_mm / (p - centre_in_eye).cwiseQuotient(half_axes_mm).norm();
        if (known.holds(c, r, s) || -p.z() < first_depth_mm || wall_mm - radius_mm < inside_wall_mm) return;
        Sample sample;
        sample.position = position;
        sample.stack = static_cast<std::uint8_t>(k);
        const double coil = at.coil(sample);
        const double brighter = stack.at(c, r, s) / (fit.stacks[k].reference * coil) - fit.value(vitreous);
        const double noise = fit.stacks[k].sampling.noise / coil;
        if (std::abs(brighter) > std::max(least_share_of_step * std::abs(step), least_noise_sigmas * noise))
          foreign[{c, r, s}] = brighter / step;
      });
  return foreign;
}

/// Those that touch each other by their faces.
std::vector<Foreign> pieces_of(Foreign foreign) {
  std::vector<Foreign> pieces;
  while (!foreign.empty()) {
    Foreign& piece = pieces.emplace_back();
    std::vector<Foreign::node_type> front;
    front.push_back(foreign.extract(foreign.begin()));
    while (!front.empty()) {
      const std::array<int, 3> voxel = front.back().key();
      piece.insert(std::move(front.back()));
      front.pop_back();
      for (const std::size_t axis : {0, 1, 2})
        for (const int way : {-1, 1}) {
          std::array<int, 3> neighbour = voxel;
          neighbour[axis] += way;
          if (auto node = foreign.extract(neighbour)) front.push_back(std::move(node));
        }
    }
  }
  return pieces;
}

/// The largest piece of a stack, and all that are large with what lies about them.
struct Pieces {
  IntraocularMass largest;
  VoxelMask about;
};
Pieces find_pieces(const EyeFit& fit, std::size_t k, const Stack& stack, const VoxelMask& known) {
  const double voxel_mm3 = stack.column_spacing_mm * stack.row_spacing_mm * stack.slice_spacing_mm();
  Pieces pieces;
  for (const Foreign& piece : pieces_of(foreign_voxels(fit, k, stack, known))) {
    double sum = 0;
    for (const auto& [voxel, over] : piece) sum += over;
    if (voxel_mm3 * std::abs(sum) < least_signal_mm3) continue;
    const auto voxels = static_cast<double>(piece.size());
    if (voxel_mm3 * voxels > pieces.largest.volume_mm3) pieces.largest = {voxel_mm3 * voxels, sum / voxels};
    if (pieces.about.is_empty()) pieces.about = VoxelMask(stack);
    for (const auto& [voxel, over] : piece)
      for_each_voxel_near(stack, stack.position(voxel[0], voxel[1], voxel[2]), about_piece_mm,
                          [&](int c, int r, int s, const Vector3d&) { pieces.about.add(c, r, s); });
  }
  return pieces;
}

/// In all stacks.
struct Masses {
  IntraocularMass largest;
  std::vector<VoxelMask> about;
};
/// \param known  of each stack, is left out; empty: nothing
Masses find_masses(const EyeFit& fit, const std::vector<const Stack*>& stacks,
                   const std::vector<VoxelMask>& known = {}) {
  Masses masses;
  for (std::size_t k = 0; k < stacks.size(); ++k) {
    Pieces pieces = find_pieces(fit, k, *stacks[k], known.empty() ? VoxelMask() : known[k]);
    if (pieces.largest.volume_mm3 > masses.largest.volume_mm3) masses.largest = pieces.largest;
    masses.about.push_back(std::move(pieces.about));
  }
  return masses;
}

}  // namespace

EyeFit fit_eye_beside_mass(const std::vector<const Stack*>& stacks, const EyeStart& start,
                           Weighting weighting, const std::function<void()>& advance, Evidence evidence) {
  EyeFit fit = fit_eye(stacks, start, weighting, advance, evidence);
  if (evidence == Evidence::labels) return fit;
  const Masses masses = find_masses(fit, stacks);
  if (masses.largest.volume_mm3 == 0) return fit;
  EyeStart beside = start;
  beside.left_out = masses.about;
  EyeFit again = fit_eye(stacks, beside, weighting, {}, evidence);
  // What is not in that eye was not in the eye: its first globe was wrong.
  if (find_masses(again, stacks).largest.volume_mm3 == 0) {
    fit.unexplained = masses.largest;
    return fit;
  }
  again.mass = masses.largest;
  again.unexplained = find_masses(again, stacks, masses.about).largest;
  return again;
}

}  // namespace emmetrope::segmentation
