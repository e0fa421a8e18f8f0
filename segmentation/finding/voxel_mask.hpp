#pragma once
#include <vector>

#include "segmentation/intake/volume.hpp"

namespace emmetrope::segmentation {

/// Voxels of one stack.
class VoxelMask {
 public:
  /// None.
  VoxelMask() = default;
  /// None yet, of this stack.
  explicit VoxelMask(const Stack& stack)
      : columns_(stack.columns),
        rows_(stack.rows),
        held_(static_cast<std::size_t>(stack.columns) * stack.rows * stack.slices(), 0) {}

  /// \pre the voxel is one of the stack's
  void add(int column, int row, int slice) { held_[place(column, row, slice)] = 1; }
  bool holds(int column, int row, int slice) const {
    return !held_.empty() && held_[place(column, row, slice)];
  }

 private:
  std::size_t place(int column, int row, int slice) const {
    return (static_cast<std::size_t>(slice) * rows_ + row) * columns_ + column;
  }
  int columns_ = 0, rows_ = 0;
  std::vector<char> held_;
};

}  // namespace emmetrope::segmentation
