#include "segmentation/fit/intraocular_mass.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/finding/sampling.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

/// Volume times difference from the vitreous in steps: of a tumour of 4.3 mm radius the part that is 2 mm from the wall and
/// behind the lens.
constexpr double least_signal_mm3 = 12;
constexpr double about_piece_mm = 2.5;  ///< what is mixed with it, and the wall that it stands on
constexpr double least_step_t1 = 0.1;   ///< of the surroundings' brightness; below, nothing can be told by it

/// A voxel of the vitreous: how much it is like what surrounds that, and the noise that the fit knows of, in steps.
struct VitreousVoxel {
  double over = 0, noise = 0;
};
/// By column, row and slice.
using Voxels = std::map<std::array<int, 3>, VitreousVoxel>;

/// From the vitreous to what surrounds it (T1), or to no signal (T2).
double step_of(const EyeFit& fit) {
  return (fit.weighting == Weighting::t2 ? 0 : fit.value(surround)) - fit.value(vitreous);
}

/// Voxels of stack k in the vitreous, 2 mm from the wall and behind the lens.
Voxels vitreous_voxels(const EyeFit& fit, std::size_t k, const Stack& stack) {
  constexpr double behind_lens_mm = 2.5;
  const double half_diagonal_mm =
      Vector3d(stack.column_spacing_mm, stack.row_spacing_mm, stack.slice_spacing_mm()).norm() / 2;
  const double inside_wall_mm = std::max(2.0, 1 + half_diagonal_mm);
  const double first_depth_mm =
      fit.value(anterior_chamber_depth) + fit.value(lens_thickness) + behind_lens_mm;
  const Vector3d half_axes_mm(fit.value(globe_x), fit.value(globe_y), fit.value(globe_z));
  const Vector3d centre_in_eye(0, 0, fit.value(globe_z) - fit.value(axial_length));
  const ForwardModel::AtParameters at(fit.model, fit.parameters);
  Voxels voxels;
  for_each_voxel_near(stack, fit.globe_centre_lps() - fit.head_shift_lps(k), half_axes_mm.maxCoeff(),
                      [&](int c, int r, int s, const Vector3d& position) {
                        const Vector3d p = at.to_eye(position, static_cast<int>(k));
                        // Of the ellipsoid: a wall that was drawn to a mass is dented by it.
                        const double radius_mm = (p - centre_in_eye).norm();
                        const double wall_mm =
                            radius_mm / (p - centre_in_eye).cwiseQuotient(half_axes_mm).norm();
                        if (-p.z() < first_depth_mm || wall_mm - radius_mm < inside_wall_mm) return;
                        if (fit.stacks[k].blanked.holds_voxel(c, r, s)) return;
                        Sample sample;
                        sample.position = position;
                        sample.stack = static_cast<std::uint8_t>(k);
                        const double unit = at.coil(sample) * step_of(fit);
                        voxels[{c, r, s}] = {stack.at(c, r, s) / (fit.stacks[k].reference * unit) -
                                                 fit.value(vitreous) / step_of(fit),
                                             fit.stacks[k].sampling.noise / std::abs(unit)};
                      });
  return voxels;
}

/// Those that are unlike the vitreous by more than the noise that the fit measured in its middle, ghosts included, and that
/// of all these voxels by their median deviation. What is unlike it the other way draws no wall.
Voxels unlike_voxels(const Voxels& voxels, const VoxelMask& known) {
  constexpr double least_share_of_step = 0.3, least_noise_sigmas = 5, of_median = 1.4826;
  std::vector<double> deviations;
  for (const auto& [place, voxel] : voxels) deviations.push_back(std::abs(voxel.over));
  const double spread = of_median * quantile(deviations, 0.5);
  Voxels unlike;
  for (const auto& [place, voxel] : voxels)
    if (voxel.over > std::max(least_share_of_step, least_noise_sigmas * std::max(spread, voxel.noise)) &&
        !known.holds(place[0], place[1], place[2]))
      unlike.emplace(place, voxel);
  return unlike;
}

/// Those that touch each other by their faces.
std::vector<Voxels> pieces_of(Voxels unlike) {
  std::vector<Voxels> pieces;
  while (!unlike.empty()) {
    Voxels& piece = pieces.emplace_back();
    std::vector<Voxels::node_type> front;
    front.push_back(unlike.extract(unlike.begin()));
    while (!front.empty()) {
      const std::array<int, 3> voxel = front.back().key();
      piece.insert(std::move(front.back()));
      front.pop_back();
      for (const std::size_t axis : {0, 1, 2})
        for (const int way : {-1, 1}) {
          std::array<int, 3> neighbour = voxel;
          neighbour[axis] += way;
          if (auto node = unlike.extract(neighbour)) front.push_back(std::move(node));
        }
    }
  }
  return pieces;
}

/// Marks what lies about a piece of stack k in all stacks.
void mark_about(const Voxels& piece, const EyeFit& fit, std::size_t k,
                const std::vector<const Stack*>& stacks, std::vector<VoxelMask>& about) {
  for (const auto& [place, voxel] : piece) {
    const Vector3d in_first = stacks[k]->position(place[0], place[1], place[2]) + fit.head_shift_lps(k);
    for (std::size_t j = 0; j < stacks.size(); ++j)
      for_each_voxel_near(*stacks[j], in_first - fit.head_shift_lps(j), about_piece_mm,
                          [&](int c, int r, int s, const Vector3d&) { about[j].add(c, r, s); });
  }
}

/// What lies in the vitreous and is none, and the voxels of each stack that lie about it.
struct Found {
  IntraocularMass mass;
  std::vector<VoxelMask> about;
};
/// \param known  of each stack, does not count; empty: nothing
Found find_mass(const EyeFit& fit, const std::vector<const Stack*>& stacks,
                const std::vector<VoxelMask>& known = {}) {
  Found found;
  for (const Stack* stack : stacks) found.about.emplace_back(*stack);
  if (fit.weighting == Weighting::t1 && step_of(fit) < least_step_t1) return found;
  for (std::size_t k = 0; k < stacks.size(); ++k) {
    const double voxel_mm3 =
        stacks[k]->column_spacing_mm * stacks[k]->row_spacing_mm * stacks[k]->slice_spacing_mm();
    const Voxels voxels = vitreous_voxels(fit, k, *stacks[k]);
    IntraocularMass mass;
    double sum = 0;
    for (const Voxels& piece : pieces_of(unlike_voxels(voxels, known.empty() ? VoxelMask() : known[k]))) {
      double of_piece = 0;
      for (const auto& [place, voxel] : piece) of_piece += voxel.over;
      if (voxel_mm3 * of_piece < least_signal_mm3) continue;
      sum += of_piece;
      for (const auto& [place, voxel] : piece)
        mass.voxels.push_back(stacks[k]->position(place[0], place[1], place[2]) + fit.head_shift_lps(k));
      mark_about(piece, fit, k, stacks, found.about);
    }
    const auto count = static_cast<double>(mass.voxels.size());
    mass.volume_mm3 = voxel_mm3 * count;
    if (mass.volume_mm3 <= found.mass.volume_mm3) continue;
    mass.over_step = sum / count;
    mass.stack = k;
    found.mass = std::move(mass);
  }
  return found;
}

}  // namespace

EyeFit fit_eye_beside_mass(const std::vector<const Stack*>& stacks, const EyeStart& start,
                           Weighting weighting, const std::function<void()>& advance, Evidence evidence) {
  EyeFit fit = fit_eye(stacks, start, weighting, advance, evidence);
  if (evidence == Evidence::labels) return fit;
  Found found = find_mass(fit, stacks);
  if (found.mass.volume_mm3 == 0) return fit;
  EyeStart beside = start;
  beside.left_out = std::move(found.about);
  try {
    EyeFit again = fit_eye(stacks, beside, weighting, {}, evidence);
    // What is not in that eye was not in the eye: its first globe was wrong.
    if (find_mass(again, stacks).mass.volume_mm3 > 0) {
      again.mass = found.mass;
      again.unexplained = find_mass(again, stacks, beside.left_out).mass;
      return again;
    }
  } catch (const Error& error) {  // too little is left
    if (error.status() != ExitStatus::no_result) throw;
  }
  fit.unexplained = found.mass;
  return fit;
}

bool is_in_vitreous(const IntraocularMass& mass, const EyeFit& fit) {
  const Eigen::Isometry3d eye_from_lps =
      lps_from_eye(fit.parameters.segment<3>(apex_x),
                   gaze_axis(fit.value(gaze_horizontal), fit.value(gaze_vertical)))
          .inverse();
  const Vector3d half_axes_mm = fit.parameters.segment<3>(globe_x),
                 centre(0, 0, fit.value(globe_z) - fit.value(axial_length));
  const double lens_back_mm = fit.value(anterior_chamber_depth) + fit.value(lens_thickness);
  const auto inside = std::count_if(mass.voxels.begin(), mass.voxels.end(), [&](const Vector3d& lps) {
    const Vector3d p = eye_from_lps * lps;
    return -p.z() > lens_back_mm && (p - centre).cwiseQuotient(half_axes_mm).norm() < 1;
  });
  return 2 * static_cast<std::size_t>(inside) > mass.voxels.size();
}

}  // namespace emmetrope::segmentation
