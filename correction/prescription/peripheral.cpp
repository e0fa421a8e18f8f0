#include "correction/prescription/peripheral.hpp"

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::correction {

std::vector<FieldPoint> peripheral_refraction(const EyeModel& eye, double wavelength_nm, double reach_deg,
                                              int points_across) {
  // The image of a direction lies on the other side of the axis, about as far as the nodal ray says.
  const double nodal_to_retina_mm =
      eye.axial_length_mm() - cardinal_points(eye, wavelength_nm).image_nodal_mm;
  const double reach_mm = nodal_to_retina_mm * reach_deg * degree;
  std::vector<FieldPoint> field;
  for (int row = 0; row < points_across; ++row)
    for (int column = 0; column < points_across; ++column) {
      const double half = 0.5 * (points_across - 1);
      raytrace::WavefrontSettings settings;
      settings.wavelength_nm = wavelength_nm;
      settings.order = 4;
      settings.fovea_mm = reach_mm / half * Eigen::Vector2d(half - column, row - half);
      try {
        const raytrace::Wavefront wavefront = raytrace::measure_wavefront(eye, settings);
        field.push_back(
            {wavefront.line_of_sight_deg.x(), wavefront.line_of_sight_deg.y(), wavefront.minimum_rms_spot});
      } catch (const Error& error) {
        if (error.status() != ExitStatus::no_result) throw;
      }
    }
  return field;
}

}  // namespace emmetrope::correction
