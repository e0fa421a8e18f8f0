#pragma once
#include <Eigen/Core>

#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/model/eye_model.hpp"
#include "raytrace/tracer/tracer.hpp"

/// Refractions by other means than the project's: exact rays into the eye behind an ideal thin lens. The
/// wavefront analysis traces out of the eye, the sharpness search traces images through real lenses.
namespace emmetrope::correction {

/// M, J0, J45 (D) of an ideal thin lens in a plane.
using Lens = Eigen::Vector3d;

/// Narrow pencils: the landing point is linear in place and slope, y = A x + B u, and the lens makes it
/// A - B P = 0.
Lens paraxial_by_pencils(const EyeModel& eye, double wavelength_nm, double vertex_distance_mm);

/// Rays over the whole pupil and where they land on the retina, linear in the lens about one that is near.
class LandingSpots {
 public:
  /// \pre the eye has its pupil
  LandingSpots(const EyeModel& eye, double wavelength_nm, double vertex_distance_mm, const Lens& near);

  /// The lens of the smallest root mean square spot: linear least squares, repeated until it rests.
  const Lens& smallest_spot() const { return best_; }

  /// Mean MTF^2 of the geometric blur under gradient energy's weight on the refraction chart.
  double sharpness(const Lens& lens, double arcmin_per_mm) const;

  /// Lens of the highest sharpness by exhaustive search: every lens within 0.3 D of the smallest spot in
  /// steps of 0.1 D, then every lens within 0.1 D of the best in steps of 0.05 D, then the vertex of
  /// parabolas.
  Lens sharpest(double arcmin_per_mm) const;

 private:
  struct LandedRay {
    Eigen::Vector2d at_mm;                 ///< behind best_, from the mean
    Eigen::Matrix<double, 2, 3> per_D_mm;  ///< by M, J0, J45, from the mean
    double weight = 0;                     ///< share of the beam's area
  };
  Lens best_;
  std::vector<LandedRay> rays_;
};

/// One eye's refractions at the vertex distance.
struct ClosedLoop {
  Lens paraxial, spot, sharpest;                                ///< as the project finds them
  Lens paraxial_by_pencils, smallest_spot, sharpest_by_search;  ///< by other means
  int images = 0;
  bool converged = false;

  double paraxial_error_D() const { return (paraxial - paraxial_by_pencils).norm(); }
  double spot_error_D() const { return (spot - smallest_spot).norm(); }
  double sharpness_error_D() const { return (sharpest - sharpest_by_search).norm(); }
  /// Of the minimum-rms-spot cylinder's axis.
  double axis_error_deg() const;
  double cylinder_D() const { return 2 * smallest_spot.tail<2>().norm(); }
};
/// Iris 3 mm, 589.3 nm; the search for the sharpest image starts without a lens.
ClosedLoop closed_loop(const raytrace::Tracer& tracer, const EyeModel& eye, double vertex_distance_mm);

}  // namespace emmetrope::correction
