#pragma once
#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "data_samples/phantom/coil.hpp"
#include "data_samples/phantom/k_space.hpp"

namespace emmetrope::phantom {

/// The vitreous (T2) or fat (T1) has this intensity where the coil's sensitivity is 1.
inline constexpr double reference_intensity = 1000;

/// Points across a slice and their weights, which sum to 1.
struct Layers {
  std::vector<double> begin_mm;          ///< where each layer begins, from the slice's middle
  std::vector<double> weight;            ///< the slice profile
  std::vector<double> shift_x, shift_y;  ///< of a layer's points within their fine cells, -0.5 to 0.5
  double step_mm = 0;

  double extent_mm() const { return step_mm * static_cast<double>(weight.size()); }
};
/// \param per_thickness  layers within the slice's thickness
Layers layers_of(SliceProfile profile, double thickness_mm, int per_thickness);

/// Where a slice lies and how the object lies under it.
struct SlicePose {
  Eigen::Vector3d first_voxel;            ///< centre, LPS
  Eigen::Isometry3d object_from_scanner;  ///< undoes the head's movement
  double scale = 1;                       ///< lengths in the image over true lengths, about the isocentre
};

/// Samples the object on the fine grid of one slice, as often as a border asks for.
class SliceSampler {
 public:
  /// The anatomy, the plan and the sensitivity must outlive the sampler.
  /// \param columns, rows  of the grid to be sampled, margins included
  /// \param layers_near_globe, layers_elsewhere  through the slice
  SliceSampler(const Anatomy& anatomy, const StackPlan& plan, const Sensitivity& sensitivity,
               const SlicePose& pose, int columns, int rows, int layers_near_globe, int layers_elsewhere);
  FineSlice sample() const;

 private:
  std::size_t index(int column, int row) const { return static_cast<std::size_t>(row) * columns_ + column; }
  Eigen::Vector3d in_scanner(double column, double row, double across_mm) const;
  Eigen::Vector3d in_object(const Eigen::Vector3d& scanner_point) const;
  bool homogeneous(int column, int row, Tissue& tissue) const;
  void fill(FineSlice& slice, int column, int row, bool border, Tissue tissue) const;

  const Anatomy& anatomy_;
  const StackPlan& plan_;
  const Sensitivity& sensitivity_;
  SlicePose pose_;
  int columns_, rows_;
  Layers layers_, far_layers_;  ///< around the globes; in the rest of the head
  std::array<double, tissue_count> signal_{};
};

}  // namespace emmetrope::phantom
