#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pipeline/base/laterality.hpp"
#include "segmentation/finding/blanked_region.hpp"
#include "segmentation/finding/voxel_mask.hpp"
#include "segmentation/fit/forward_model.hpp"
#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Where an eye is and where it looks, roughly: what the fit starts from.
struct EyeStart {
  Eigen::Vector3d globe_centre;  ///< LPS, mm
  double globe_radius_mm = 11.5;
  Eigen::Vector3d axis;                       ///< unit, out of the eye, LPS
  std::optional<Eigen::Vector3d> other_axis;  ///< to start from too
  /// Where the head has moved between the stacks: a point of stack k plus stack_shift[k] is where it lies in
  /// the first. Empty: nowhere.
  std::vector<Eigen::Vector3d> stack_shift;
  std::optional<double> age_years;  ///< of the patient; the lens changes with it
  std::optional<Laterality> laterality;
  /// Parameters of the person's other eye, fitted to the same stacks, to start from too; fat is displaced here as it
  /// is there. The globe's half axes are those along the voxels, all else is along the patient's axes. Empty: none.
  Eigen::VectorXd fellow = {};
  /// Where its front was found: on the way this one's is about as deep.
  std::optional<double> fellows_chamber_mm = {};
  /// Where half-level edges told them: the interface's half axes along the voxels, and the apex' distance from the centre.
  std::optional<Eigen::Vector3d> globe_half_axes_mm = {};
  std::optional<double> apex_distance_mm = {};
  std::vector<EyeStart> others = {};     ///< to start from too: what explains the images best is taken
  std::vector<VoxelMask> left_out = {};  ///< of each stack; empty: none

  /// The same eye as it lies in stack k.
  EyeStart in_stack(std::size_t k) const {
    EyeStart shifted = *this;
    if (k < stack_shift.size()) shifted.globe_centre -= stack_shift[k];
    return shifted;
  }
};

/// What the voxels of the stacks hold.
enum class Evidence {
  intensities,  ///< a scanner's
  labels,       ///< tissues that somebody drew: the levels below
};

inline const char* to_string(Evidence evidence) {
  return evidence == Evidence::labels ? "labels" : "intensities";
}

/// What a voxel of a tissue is worth where labels are the evidence: neighbours differ by 1, the iris by 1/2.
inline constexpr double fluid_level = 1, solid_level = 0, iris_level = 0.5, outside_level = 1;
/// Deviation of a label's voxel from the model. A label is a point sample: it says of an edge along a line of
/// voxels of spacing s that it lies within one, a deviation of s/sqrt(12). The model's edge is one pixel h
/// wide in every direction, so that its squared slope sums to 1/(h s) on the average: hence sqrt(s/h/12),
/// with s the coarsest spacing. Where slices are thick this is too cautious within their plane.
double label_deviation(const Stack& stack);

/// A stack as the fit sees it.
struct ObservedStack {
  const Stack* stack = nullptr;
  double reference = 1;  ///< the intensity that becomes 1: TissueLevels::reference
  StackSampling sampling;
  /// Unit vector of the eye frame from the globe's centre to the optic nerve, where its surroundings hide
  /// the wall (Selection::optic_nerve); none: nothing hides it.
  std::optional<Eigen::Vector3d> optic_nerve;
  BlankedRegion blanked = {};     ///< its voxels tell nothing
  VoxelMask left_out = {};        ///< nor do these
  bool front_is_blanked = false;  ///< lens and cornea with it
  bool fat_is_dark = false;       ///< TissueLevels::fat_is_dark
};

/// Whether lens and cornea are blanked in all of them.
bool front_is_blanked(const std::vector<ObservedStack>& stacks);

/// Whether fat is dark in one of them.
bool fat_is_dark(const std::vector<ObservedStack>& stacks);

/// Side of the pixels in the stack where they are smallest; the longer one where they are no squares.
double finest_pixel_mm(const std::vector<ObservedStack>& stacks);

/// Typical intensities of the tissues of an eye in one stack, in its own unit.
struct TissueLevels {
  double vitreous = 0, wall = 0, lens = 0, lid = 0, air = 0, surround = 0, fat = 0;

  /// In T1: fat was suppressed, not excited or nulled, so that what surrounds the globe is darker than its wall.
  bool fat_is_dark() const { return surround < wall; }
  /// What becomes 1: the vitreous in T2; in T1 what surrounds the globe, or its wall where fat is dark.
  double reference(Weighting weighting) const;
};
TissueLevels tissue_levels(const Stack& stack, const EyeStart& start, Weighting weighting);

/// Sigma of the noise (one channel) in the vitreous: residual of a quadratic in each slice, corrected for the
/// Rician magnitude.
/// \param left_out  is none
/// \throw Error (no_result) when there are too few voxels in it
double vitreous_noise(const Stack& stack, const EyeStart& start, const VoxelMask& left_out = {});

/// Normalises stacks; their noise and resolution.
std::vector<ObservedStack> observe(const std::vector<const Stack*>& stacks, const EyeStart& start,
                                   Weighting weighting, Evidence evidence = Evidence::intensities);

/// Which voxels a pass uses.
struct Selection {
  bool cornea = true;       ///< voxels near the cornea and the lid
  bool rear = true;         ///< voxels behind mid-lens
  bool fields = true;       ///< the wall's displacement and background are free
  int stride = 1;           ///< one voxel in so many
  bool optic_nerve = true;  ///< voxels of the wall about the optic nerve, where that is told
  double outside_mm = 0.6;  ///< beyond the wall, or 0.6 pixels
};
/// Voxels near a modelled surface at these parameters, with what matters to each; in the order of the stacks.
std::vector<Sample> select_samples(const ForwardModel& model, const Eigen::VectorXd& parameters,
                                   const std::vector<ObservedStack>& stacks, const Selection& selection);

}  // namespace emmetrope::segmentation
