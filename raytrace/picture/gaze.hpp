#pragma once
#include <Eigen/Geometry>

namespace emmetrope::raytrace {

/// Where an eye looks, against straight ahead: to the patient's left (eye +x) and up; tangents add up as the
/// coordinates of the point looked at do.
struct Gaze {
  double horizontal_deg = 0, vertical_deg = 0;
};

/// How an eye stands in the scene.
struct EyePose {
  Eigen::Vector3d apex_mm{0, 0, 0};  ///< the corneal apex while the eye looks straight ahead, scene frame
  double rotation_centre_mm = 13.5;  ///< behind the apex
  Gaze gaze;

  /// \throw Error (usage) for a gaze beyond what an eye can turn to
  void check() const;
  /// The turn from straight ahead, by Listing's law: about an axis in the frontal plane, without torsion.
  Eigen::Isometry3d turned_from_straight() const;
  /// The scene as the turned eye's own frame sees it.
  Eigen::Isometry3d eye_from_scene() const;
};

/// The gaze that brings the axis of an eye through a point of the scene; with a deviation in prism dioptres
/// (left, up) as the eye itself sees it, for an eye that squints.
/// \throw Error (usage) for a point that is not in front of it
Gaze gaze_at(const EyePose& eye, const Eigen::Vector3d& point_mm,
             const Eigen::Vector2d& deviation_prism = {0, 0});

}  // namespace emmetrope::raytrace
