#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "pipeline/eye/optics/retina_point.hpp"
#include "pipeline/eye/optics/stop_crossing.hpp"
#include "raytrace/picture/trace_settings.hpp"

namespace emmetrope::raytrace {

/// The stop as a point of the retina sees it through what lies between: an ellipse on a plane z = plane_z_mm.
struct AimEllipse {
  Eigen::Vector2d centre_mm{0, 0};
  Eigen::Matrix2d from_disc = Eigen::Matrix2d::Zero();  ///< the unit disc to the ellipse
};

/// The smallest ellipse of its form about the stop as a point of the retina sees it; nothing where no ray from there
/// passes the stop's centre.
std::optional<AimEllipse> aim_ellipse(const StopCrossing& crossing, const Eigen::Vector3d& retina,
                                      double plane_z_mm);

/// Aim ellipses over the field: exact rays from 6 x 6 retinal points to the stop's rim, interpolated.
/// Every ellipse is just large enough to hold the whole image of the stop, so that nothing is cut and few
/// rays are lost.
class PupilAim {
 public:
  /// \throw Error (input_invalid) when the eye has no stop, or no ray from the retina passes it
  PupilAim(const EyeModel& eye, const RetinalGrid& grid, double wavelength_nm, int threads = 1);

  double plane_z_mm() const { return plane_z_mm_; }
  /// \param x, y  on the retina, eye frame, inside the grid
  AimEllipse at(double x_mm, double y_mm) const { return along_row(y_mm, {x_mm}).front(); }
  /// The same for all points of a row of the grid, in a fraction of the time.
  std::vector<AimEllipse> along_row(double y_mm, const std::vector<double>& x_mm) const;

 private:
  double plane_z_mm_ = 0;
  Eigen::Vector2d centre_, half_;
  std::vector<AimEllipse> nodes_;  ///< row after row
};

/// The retina at eye x and y.
/// \throw Error (input_invalid) when the retina does not reach there
RetinaPoint retina_point(const EyeModel& eye, double x_mm, double y_mm);

}  // namespace emmetrope::raytrace
