#pragma once
#include "pipeline/eye/model/eye_model.hpp"

namespace emmetrope::raytrace {

/// Area of the entrance pupil as it is seen along the line of sight of the retina's pole: what stop and surfaces let
/// through, by exact rays. Paraxially it is 8 % larger behind an iris of 8 mm (Navarro). Paraxially
/// without a stop, or where that line of sight does not leave the eye or its spectacle.
double seen_pupil_area_mm2(const EyeModel& eye, double wavelength_nm);

/// By how much what the eye wears enlarges its entrance pupil, to first order; 1 without.
double pupil_magnification_of_spectacle(const EyeModel& eye, double wavelength_nm);

}  // namespace emmetrope::raytrace
