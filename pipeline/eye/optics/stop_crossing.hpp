#pragma once
#include <optional>
#include <string>

#include "pipeline/eye/optics/exact_trace.hpp"

namespace emmetrope {

/// Where exact rays cross the plane of the stop, inside the eye.
class StopCrossing {
 public:
  /// \throw Error (input_invalid) when the eye has no stop
  StopCrossing(const EyeModel& eye, double wavelength_nm);

  double stop_radius_mm() const { return radius_mm_; }
  /// Of the ray from a point of the retina towards another, from the centre of the stop, in its frame; nothing
  /// where the ray does not come so far.
  std::optional<Eigen::Vector2d> operator()(const Eigen::Vector3d& retina,
                                            const Eigen::Vector3d& target) const;
  /// Of a ray that enters the eye.
  std::optional<Eigen::Vector2d> inward(const Ray& ray_in_eye) const;

 private:
  std::optional<Eigen::Vector2d> in_stop_plane(const Ray& straight) const;
  /// The ray behind its hit on a surface (itself where that has no name); nothing where it ends before.
  std::optional<Ray> beyond(const std::string& surface, const Ray& ray, bool inward) const;

  ExactTracer open_;  ///< the stop cuts nothing
  double radius_mm_ = 0;
  Eigen::Isometry3d stop_from_eye_;
  std::string before_stop_, behind_stop_;  ///< the surfaces between which the ray is straight; "": none
};

/// The plane across the axis that rays out of the eye are aimed at: the exit pupil's, or where that lies far away
/// (a pinhole before the cornea) the one at the vertex of what stands before the retina.
double aim_plane_z_mm(const EyeModel& eye, double wavelength_nm);

/// Where on a plane z = `plane_z_mm` a point of the retina sees the stop's centre.
struct StopCentreAim {
  Eigen::Vector2d aim_mm{0, 0};
  Eigen::Matrix2d aim_from_stop = Eigen::Matrix2d::Identity();  ///< how the aim follows the place in the stop
};
/// Nothing where no ray finds it.
std::optional<StopCentreAim> aim_at_stop_centre(const StopCrossing& crossing, const Eigen::Vector3d& retina,
                                                double plane_z_mm);

}  // namespace emmetrope
