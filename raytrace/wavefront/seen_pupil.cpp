#include "raytrace/wavefront/seen_pupil.hpp"

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "raytrace/wavefront/retinal_pencil.hpp"

namespace emmetrope::raytrace {

double seen_pupil_area_mm2(const EyeModel& eye, double wavelength_nm) {
  try {
    const RetinalPencil pencil(eye, wavelength_nm, {0, 0});
    if (pencil.has_stop()) return pencil.rim().area_mm2();
  } catch (const Error& error) {
    if (error.status() != ExitStatus::no_result) throw;
  }
  const double diameter_mm = entrance_pupil(eye, wavelength_nm).diameter_mm;
  return pi * diameter_mm * diameter_mm / 4;
}

double pupil_magnification_of_spectacle(const EyeModel& eye, double wavelength_nm) {
  return entrance_pupil(eye, wavelength_nm).diameter_mm /
         entrance_pupil(without_spectacle(eye), wavelength_nm).diameter_mm;
}

}  // namespace emmetrope::raytrace
