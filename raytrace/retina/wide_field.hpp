#pragma once
#include <Eigen/Core>
#include <vector>

#include "raytrace/retina/field_points.hpp"
#include "raytrace/retina/retina_pixels.hpp"

namespace emmetrope::raytrace {

/// What every pixel needs (RetinaPixels), over fields as wide as the eye sees, beyond the retina's equator.
///
/// It is found by exact rays at nodes along meridians through the picture's centre, which end where the eye sees
/// no further, and interpolated between them (Lagrange, six nodes each way). Memory does not grow with the field.
class WideField {
 public:
  /// \param wavelength_nm  of the light that goes through the pupil
  /// \param place_wavelength_nm  of the chief rays that find the pixels' places
  /// \throw Error (input_invalid) when the eye has no stop, or nothing is seen from the field's centre
  WideField(const EyeModel& eye, const RetinalGrid& grid, double wavelength_nm, double place_wavelength_nm,
            int threads);

  double plane_z_mm() const { return plane_z_mm_; }
  /// Pixels where the eye sees nothing are marked as unseen.
  RetinaPixels pixels(int threads) const;

 private:
  using Values = Eigen::Matrix<double, RetinaPixels::floats_a_pixel, 1>;
  std::optional<Values> exact(const Eigen::Vector2d& place) const;
  /// How far along a meridian the eye sees.
  double seen_until(const Eigen::Vector2d& along) const;
  const Values& node(int meridian, int ring) const;
  std::optional<Values> between_nodes(const Eigen::Vector2d& place) const;

  RetinalGrid grid_;
  Eigen::Vector2d half_;
  FieldPoints points_;  ///< of the nodes
  StopCrossing crossing_;
  double plane_z_mm_;
  Values centre_;
  std::vector<double> limits_;  ///< places, a meridian each
  std::vector<Values> nodes_;   ///< rings of a meridian together
};

}  // namespace emmetrope::raytrace
