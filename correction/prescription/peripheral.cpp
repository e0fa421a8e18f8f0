#include "correction/prescription/peripheral.hpp"

#include "raytrace/wavefront/field.hpp"

namespace emmetrope::correction {

std::vector<FieldPoint> peripheral_refraction(const EyeModel& eye, double wavelength_nm, double reach_deg,
                                              int points_across) {
  const ChiefRays chief_rays(eye, wavelength_nm);
  raytrace::WavefrontSettings settings;
  settings.wavelength_nm = wavelength_nm;
  settings.order = 4;
  const double half = 0.5 * (points_across - 1), step_deg = reach_deg / half;
  std::vector<FieldPoint> field;
  for (int row = 0; row < points_across; ++row)
    for (int column = 0; column < points_across; ++column) {
      const Eigen::Vector2d direction_deg = step_deg * Eigen::Vector2d(column - half, half - row);
      if (const auto at = wavefront_towards(eye, chief_rays, direction_deg, settings))
        field.push_back({direction_deg.x(), direction_deg.y(), at->wavefront.minimum_rms_spot});
    }
  return field;
}

}  // namespace emmetrope::correction
