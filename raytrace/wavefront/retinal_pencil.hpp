#pragma once
#include <optional>

#include "pipeline/eye/optics/stop_crossing.hpp"
#include "raytrace/wavefront/pupil_rim.hpp"

namespace emmetrope::raytrace {

/// A ray where it crosses the reference plane, in that plane's axes.
struct PlaneCrossing {
  Eigen::Vector2d position_mm{0, 0};
  Eigen::Vector2d slope{0, 0};   ///< direction cosines
  double opl_mm = 0;             ///< from the retinal point to the plane
  Eigen::Vector2d aim_mm{0, 0};  ///< where it was aimed inside the eye
};

/// All rays of one retinal point out of an eye, its stop wide open, known by where they cross the reference
/// plane: the entrance pupil's, perpendicular to the line of sight.
class RetinalPencil {
 public:
  /// \param fovea_mm  the retinal point, eye x and y from the pole
  /// \throw Error (input_invalid) where the retina does not reach; (no_result) where no light leaves the eye
  RetinalPencil(const EyeModel& eye, double wavelength_nm, const Eigen::Vector2d& fovea_mm);

  /// The ray through a point of the reference plane; nothing where none leaves the eye.
  std::optional<PlaneCrossing> through(const Eigen::Vector2d& plane_mm) const;
  /// How far rays in the plane's direction `angle_rad` pass both the stop and all surfaces.
  /// \pre the eye has a stop
  PupilRim rim() const;

  bool has_stop() const { return stop_.has_value(); }
  const Eigen::Vector3d& line_of_sight() const { return line_of_sight_; }
  const Eigen::Vector3d& centre() const { return centre_; }  ///< of the entrance pupil
  /// Along the meridian that holds the eye's axis and the line of sight, in the plane's axes; y where they lie
  /// within a degree of each other.
  Eigen::Vector2d tangential() const;

 private:
  Eigen::Vector3d target(const Eigen::Vector2d& aim) const { return {aim.x(), aim.y(), aim_plane_z_mm_}; }
  Ray aimed(const Eigen::Vector2d& aim) const { return {source_, (target(aim) - source_).normalized()}; }
  void find_line_of_sight(double entrance_pupil_z_mm);
  std::optional<PlaneCrossing> crossing(const Eigen::Vector2d& aim) const;
  double rim_radius_mm(const Eigen::Vector2d& direction, double first_guess_mm) const;

  ExactTracer tracer_;
  std::optional<StopCrossing> stop_;
  Eigen::Vector3d source_;
  double aim_plane_z_mm_;
  Eigen::Vector2d chief_aim_{0, 0};  ///< straight ahead where there is no stop
  Eigen::Matrix2d plane_from_aim_ = Eigen::Matrix2d::Identity();
  Eigen::Vector3d line_of_sight_, centre_, x_axis_, y_axis_;
};

}  // namespace emmetrope::raytrace
