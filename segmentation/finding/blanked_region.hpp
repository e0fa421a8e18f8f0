#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "segmentation/finding/sampling.hpp"
#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Where someone blanked the image around an eye, as those do who take a face off: with zero or, where values were
/// rescaled since, with the lowest and commonest value of all. Noise leaves no voxel that is so with all its
/// neighbours. Nothing can be read there, nor where an interpolation would reach into it.
class BlankedRegion {
 public:
  /// Nothing is blanked.
  BlankedRegion() = default;
  /// In the whole stack.
  explicit BlankedRegion(const Stack& stack);
  /// Within so far of the globe's centre (LPS); nothing where most of its middle is blank and less than a third of what
  /// lies around it, as dark vitreous is in a window.
  BlankedRegion(const Stack& stack, const Eigen::Vector3d& globe_centre, double radius_mm);

  /// Whether a value is what the image was blanked with.
  bool is_blank(double value) const;
  /// Blank, or within two voxels of what is blank with its neighbours.
  bool holds_voxel(int column, int row, int slice) const;
  /// Whether an interpolation over four voxels a direction reaches to a voxel that is blank with its neighbours.
  /// \param stack  the one that it is of
  bool holds(const Sampler& stack, const Eigen::Vector3d& lps) const;
  /// Whether a quarter of a usual lens, 8 mm before the globe's centre, was blanked and nearly all that lies before it:
  /// a lens that is dark in a whole head has a bright chamber or lid before it.
  bool holds_front(const Stack& stack, const Eigen::Vector3d& globe_centre,
                   const Eigen::Vector3d& axis) const;
  /// Whether the image was cut off at what was taken for a cornea: a disc 5 mm wide, 0.3 to 1.3 mm before its apex, where
  /// the lid is, is blank, and the blank ends in a plane. Air that was masked before an open eye ends on the cornea, which
  /// lies 1.7 mm further back 5 mm beside its apex.
  /// \return the disc's blank share, 0 where it does not end in a plane; nothing where less than half of it is in the stack
  std::optional<double> share_cut_before(const Stack& stack, const Eigen::Vector3d& apex,
                                         const Eigen::Vector3d& axis) const;

 private:
  /// Of so many voxels from the first on.
  void find_cores(const Stack& stack, const Eigen::Array3i& first, const Eigen::Array3i& count);
  bool is_core(const Eigen::Array3i& voxel) const;
  bool is_core_within(const Eigen::Array3i& voxel, int reach) const;
  bool is_lost(const Sampler& stack, const Eigen::Vector3d& lps) const;
  bool is_blank_with_neighbours(const Stack& stack, int column, int row, int slice) const;

  Eigen::Array3i first_ = Eigen::Array3i::Zero(), count_ = Eigen::Array3i::Zero();  ///< column, row, slice
  std::vector<char> core_;  ///< of the voxels from `first_` on: blank with all neighbours
  double value_ = 0;        ///< that the stack was blanked with, if not with zero
};

/// That region where it holds the front of the eye, or nothing: the air before a whole face, which is zero in many
/// images, stays.
BlankedRegion blanked_front(const Stack& stack, const Eigen::Vector3d& globe_centre,
                            const Eigen::Vector3d& axis, double radius_mm);

}  // namespace emmetrope::segmentation
