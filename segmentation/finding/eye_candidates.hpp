#pragma once
#include <Eigen/Core>
#include <vector>

#include "segmentation/intake/volume.hpp"
#include "segmentation/intake/weighting.hpp"

namespace emmetrope::segmentation {

/// A globe seen in one stack.
struct EyeCandidate {
  Eigen::Vector3d centre;  ///< LPS, mm
  double radius_mm = 0;    ///< of the strongest step: the inner wall in T2, the outer one in T1
  Weighting weighting = Weighting::t2;
  /// Share of the directions inside the stack whose edge lies on the sphere (within 1.2 mm)
  double agreement = 0;
  double blanked = 0;             ///< share of the directions whose wall was blanked, if that was asked for
  double inside = 0;              ///< of the others, share whose wall lies inside the stack
  double contrast_to_spread = 0;  ///< step across the wall over the vitreous' own spread
  double score() const { return agreement * inside; }
};

/// What voxels that are zero with all their neighbours are (blanked_region.hpp): dark ones of the image, or blanked by
/// those who take faces off. Blanked ones tell nothing, nor do edges that touch them.
enum class Zeros { dark, blanked };

/// Globes in a stack, best first: places of radial symmetry (radial_symmetry.hpp), each checked and refined
/// on radial profiles. Several may be false; pairing and the fit decide. Whatever the order of the voxels is
/// (canonical_stack.hpp).
std::vector<EyeCandidate> find_candidates(const Stack& stack, Zeros zeros = Zeros::dark);

}  // namespace emmetrope::segmentation
