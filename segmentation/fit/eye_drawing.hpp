#pragma once
#include <Eigen/Core>
#include <array>
#include <vector>

#include "segmentation/fit/eye_surfaces.hpp"
#include "segmentation/fit/forward_model.hpp"

namespace emmetrope::segmentation {

/// The tissues of the fitted eye in space, without coil: what ForwardModel has in front and at the rear,
/// joined; iris and ciliary body are left out. Means over small cells, so that borders are smooth between
/// them.
class EyeDrawing {
 public:
  /// \param cell  edges of the cells, in the eye frame (columns)
  /// \param voxel_reach_mm  how far a voxel reaches from its middle
  /// \param at, parameters  must outlive the drawing
  EyeDrawing(const ForwardModel& model, const ForwardModel::AtParameters& at,
             const Eigen::VectorXd& parameters, int stack, const Eigen::Matrix3d& cell,
             double voxel_reach_mm);

  /// Goes to the voxel about a point of the eye frame.
  /// \return whether a border may cross it
  bool enter(const Eigen::Vector3d& middle);

  /// Mean intensity of a cell about a point of the voxel.
  double operator()(const Eigen::Vector3d& p) const;

 private:
  enum Surface {
    lid_front,
    cornea_front,
    cornea_back,
    wall_outside,
    wall_between,
    wall_inside,
    fat_begins,
    lens_front,
    lens_back,
    lens_equator,
    nucleus,
    surface_count
  };

  /// Any but the lens' three, which come together.
  EyeSurface surface(Surface which, const Eigen::Vector3d& p) const;
  double share_inside(const EyeSurface& s) const;
  double in_lens(const Eigen::Vector3d& p) const;
  double coverage(Surface which, const Eigen::Vector3d& p) const;
  double joined(double rear, Surface of_cornea, Surface of_globe, const Eigen::Vector3d& p) const;

  const ForwardModel::AtParameters& at_;
  const Eigen::VectorXd& a_;
  Eigen::Matrix3d cell_;
  double reach_;
  double fat_, muscle_;
  Eigen::Vector3d fat_shift_;  ///< in the eye frame
  std::vector<Eigen::Vector3d> bumps_;
  std::vector<std::uint8_t> near_;  ///< bumps that matter in the voxel
  Eigen::Vector3d middle_;
  WallFields fields_;
  std::array<double, surface_count> distance_{};  ///< of the voxel's middle
};

/// 0 before `from`, 1 beyond `to`, with a continuous slope.
double smooth_step(double x, double from, double to);

}  // namespace emmetrope::segmentation
