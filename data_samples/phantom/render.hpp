#pragma once
#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "data_samples/phantom/acquisition.hpp"

namespace emmetrope::phantom {

/// A stack as the scanner shows it.
struct RenderedStack {
  StackPlan plan;
  /// Where the head was: a point that lies at x in the reference pose (that of truth) lies at this times x.
  Eigen::Isometry3d scanner_from_reference = Eigen::Isometry3d::Identity();
  double sigma = 0;                        ///< of one channel's noise
  std::vector<std::vector<float>> slices;  ///< magnitude, rows x columns, row after row
  /// Centre of a voxel in LPS, as the images' header says.
  Eigen::Vector3d position(double column, double row, int slice) const {
    return plan.slice_position(slice) + column * plan.pixel_mm * plan.along_row +
           row * plan.pixel_mm * plan.along_column;
  }
};

/// Renders stack number `index` of a protocol: tissue sampled at 4 x 4 x 10 points (4 x 4 x 4 farther than 19
/// mm from the centres of the globes; of encoded slices four layers with 4 x 4 x 3 or 4 x 4 x 1) in every voxel that a
/// border may cross, coil, Fourier transform,
/// k-space cut to what was acquired, noise in both channels, magnitude. Deterministic in protocol, index and
/// seed, whatever the number of threads.
/// \param advance  called after each slice, from any thread; may be empty
RenderedStack render(const Anatomy& anatomy, const Protocol& protocol, std::size_t index, int threads = 1,
                     const std::function<void()>& advance = {});

}  // namespace emmetrope::phantom
