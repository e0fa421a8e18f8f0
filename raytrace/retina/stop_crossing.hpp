#pragma once
#include <optional>
#include <string>

#include "pipeline/eye/optics/exact_trace.hpp"

namespace emmetrope::raytrace {

/// Where exact rays from the retina cross the plane of the stop, inside the eye.
class StopCrossing {
 public:
  /// \throw Error (input_invalid) when the eye has no stop
  StopCrossing(const EyeModel& eye, double wavelength_nm);

  double stop_radius_mm() const { return radius_mm_; }
  /// Of the ray from a point of the retina towards another, from the centre of the stop, in its frame; nothing
  /// where the ray does not come so far.
  std::optional<Eigen::Vector2d> operator()(const Eigen::Vector3d& retina,
                                            const Eigen::Vector3d& target) const;

 private:
  ExactTracer open_;  ///< the stop cuts nothing
  double radius_mm_ = 0;
  Eigen::Isometry3d stop_from_eye_;
  std::string behind_stop_;  ///< the surface between which and the stop the ray is straight
};

}  // namespace emmetrope::raytrace
