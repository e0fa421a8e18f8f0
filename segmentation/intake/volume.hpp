#pragma once
#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "segmentation/intake/weighting.hpp"

namespace emmetrope::segmentation {

/// One stack of parallel MR slices. Every slice keeps the position that its header gives: a missing slice
/// leaves a gap, it is never squeezed or filled in. LPS, mm.
struct Stack {
  std::string name;  ///< file-safe, never from a tag: "stack1"
  int columns = 0, rows = 0;
  /// Unit: direction in which the column index grows (ImageOrientationPatient 1 to 3)
  Eigen::Vector3d along_row;
  Eigen::Vector3d along_column;  ///< unit: direction in which the row index grows (4 to 6)
  Eigen::Vector3d normal;        ///< along_row x along_column; slices are ordered by position along it
  double column_spacing_mm = 0;  ///< between columns, along_row (PixelSpacing 2)
  double row_spacing_mm = 0;     ///< between rows, along_column (PixelSpacing 1)
  double slice_thickness_mm = 0;
  /// How far the image may show fat displaced against water by the chemical shift, along row and column:
  /// one standard deviation, mm. Zero where there is none.
  Eigen::Vector2d fat_shift_sigma_mm = Eigen::Vector2d::Zero();
  /// The same along slices: of a volume that was turned since its acquisition, and tells its readout.
  double fat_shift_sigma_through_mm = 0;
  /// Whether slices were acquired as they are stored (2-D): the header tells.
  bool slices_are_told = false;
  /// Whether slices were phase-encoded as rows are (3-D), by the header or, where that does not tell, as slices so thin
  /// mostly are; others have been excited one by one.
  bool slices_are_encoded = false;
  /// Where the sequence's times leave no doubt (weighting.hpp).
  std::optional<Weighting> told_weighting;
  double extent_mm = 0;  ///< longest side of the stack that this is a part of; 0: it is whole
  std::vector<Eigen::Vector3d> slice_position;      ///< centre of the first voxel of each slice, LPS
  std::vector<std::vector<float>> slice_intensity;  ///< rows x columns, row after row, after rescale

  int slices() const { return static_cast<int>(slice_position.size()); }
  float at(int column, int row, int slice) const {
    return slice_intensity[slice][static_cast<std::size_t>(row) * columns + column];
  }
  /// Centre of a voxel in LPS.
  Eigen::Vector3d position(double column, double row, int slice) const {
    return slice_position[slice] + column * column_spacing_mm * along_row +
           row * row_spacing_mm * along_column;
  }
  /// Median distance between neighbouring slices; the slice thickness where there is one slice only.
  double slice_spacing_mm() const;
};

/// Longest side of what a stack holds.
double whole_extent_mm(const Stack& stack);

}  // namespace emmetrope::segmentation
