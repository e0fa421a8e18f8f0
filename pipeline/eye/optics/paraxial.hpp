#pragma once
#include "pipeline/base/power_vector.hpp"
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope {

/// Gaussian properties; depths behind the anterior corneal apex, mm. A toric eye's cardinal points use the
/// mean curvature of each surface.
struct CardinalPoints {
  double power_D = 0;
  double object_focal_mm = 0, image_focal_mm = 0;
  double object_principal_mm = 0, image_principal_mm = 0;
  double object_nodal_mm = 0, image_nodal_mm = 0;
};
CardinalPoints cardinal_points(const EyeModel& eye, double wavelength_nm);

/// A pupil on the axis: depth and diameter.
struct Pupil {
  double position_mm = 0;
  double diameter_mm = 0;
};
/// The stop imaged by what is in front of it; the first lens surface's vertex plane is the stop where there
/// is none.
Pupil entrance_pupil(const EyeModel& eye, double wavelength_nm);
Pupil exit_pupil(const EyeModel& eye, double wavelength_nm);

/// A symmetric vergence matrix (1/mm) as a power vector.
PowerVector power_from_vergence(const Eigen::Matrix2d& vergence_per_mm);

/// Paraxial refraction at the corneal vertex, meridian by meridian (2 x 2 vergence): what corrects the eye.
/// Where surfaces or the stop are tilted or decentred it is that of rays near the pole's line of sight (through
/// the centre of the stop; along the axis where there is none), traced exactly.
/// \throw Error (no_result) when that ray does not leave the eye
PowerVector paraxial_refraction(const EyeModel& eye, double wavelength_nm);

}  // namespace emmetrope
